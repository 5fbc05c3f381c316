"""MPI Sintel stereo (Butler et al., ECCV 2012): `training/{clean,final}_{left,right}`, `disparities`,
`occlusions`, `outofframe`.

There is a disparity of the left view only. It is a colour PNG file with d = 4 R + G / 64 + B / 16384 pixels, valid
everywhere. The two masks are white where the right view does not show the point.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats import read_png
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME, VISIBLE
from datagen.formats.picture import read_picture
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame
from stereoforge_kit.files import matching

PASSES = ("clean", "final")
_UNITS = np.array([4, 1 / 64, 1 / 16384], np.float32)


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a Sintel disparity: (H, W) float32 px. Raises FormatError for a file that is none."""
    colors = read_png(path)
    if colors.dtype != np.uint8 or colors.ndim != 3:
        raise FormatError(f"{path}: a Sintel disparity is an 8-bit colour PNG, not {colors.dtype}")
    disparity: NDArray[np.float32] = colors[..., :3].astype(np.float32) @ _UNITS
    return disparity


def read_labels(occlusion: Path, out_of_frame: Path) -> NDArray[np.uint8]:
    """Occlusion labels (H, W) from Sintel's two masks. Raises FormatError for files that are none."""
    occluded, outside = (_mask(read_png(path)) for path in (occlusion, out_of_frame))
    return np.where(outside, OUT_OF_FRAME, np.where(occluded, OCCLUDED, VISIBLE)).astype(np.uint8)


def _mask(image: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.bool_]:
    return (image if image.ndim == 2 else image[..., 0]) > 0


def _training(root: Path) -> Path:
    return root / "training" if (root / "training").is_dir() else root


def _recognises(root: Path, render_pass: str) -> bool:
    """Whether the folder has a pass's images; those of the final pass count where there are no clean ones."""
    folder = _training(root)
    passes = [name for name in PASSES if (folder / f"{name}_left").is_dir()]
    return (folder / "disparities").is_dir() and passes[:1] == [render_pass]


def _find(root: str, split: str, render_pass: str) -> Sequence[StereoFrame]:  # noqa: ARG001
    return FileFrames(_frames(_training(Path(root)), render_pass))


def _frames(folder: Path, render_pass: str) -> Iterator[FileFrame]:
    for truth in matching(folder / "disparities", "*/*.png"):
        path = truth.relative_to(folder / "disparities")
        yield FileFrame(
            name=path.with_suffix("").as_posix(),
            scene_name=path.parent.as_posix(),
            read_left=partial(read_picture, folder / f"{render_pass}_left" / path),
            read_right=partial(read_picture, folder / f"{render_pass}_right" / path),
            read_disparity_left=partial(read_disparity, truth),
            read_occlusion_left=partial(
                read_labels, folder / "occlusions" / path, folder / "outofframe" / path
            ),
        )


FORMATS = tuple(
    SourceFormat(
        name, title, partial(_recognises, render_pass=render_pass), partial(_find, render_pass=render_pass)
    )
    for name, title, render_pass in (
        ("sintel", "MPI Sintel", "clean"),
        ("sintel-final", "MPI Sintel (final pass)", "final"),
    )
)

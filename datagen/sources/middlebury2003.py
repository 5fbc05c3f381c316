"""Middlebury 2003, Cones and Teddy (Scharstein and Szeliski, CVPR 2003). Every scene has a folder with `im2`, `im6`,
`disp2`, `disp6` as PPM and PGM, or as PNG.

The disparities of the left (2) and right (6) view have 8 bits. They are the grey value divided by a scale that depends
on the resolution: 4 for the quarter-size images (450 x 375), 2 for half size, 1 for full size; grey 0 where there is
none. Occlusion is derived from both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.picture import read_picture, read_raster
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame
from stereoforge_kit.files import matching

_SCALES = ((450, 4), (900, 2), (1800, 1))
"""(largest image width, grey values per pixel of disparity)."""


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a disparity of the 2003 sets: (H, W) float32 px, NaN where there is none.

    Raises FormatError for a file that is none.
    """
    values = read_raster(path)
    if values.dtype != np.uint8 or values.ndim != 2:
        raise FormatError(f"{path}: a Middlebury 2003 disparity is 8-bit grey, not {values.dtype}")
    scale = next((scale for width, scale in _SCALES if values.shape[1] <= width), None)
    if scale is None:
        raise FormatError(f"{path}: is wider than the full size of the 2003 sets, {_SCALES[-1][0]} pixels")
    disparity = values.astype(np.float32) / scale
    disparity[values == 0] = np.nan
    return disparity


def _recognises(root: Path) -> bool:
    return any(True for _ in _frames(root))


def _find(root: str, split: str) -> Sequence[StereoFrame]:  # noqa: ARG001
    return FileFrames(_frames(Path(root)))


def _frames(root: Path) -> Iterator[FileFrame]:
    for scene in (root, *filter(Path.is_dir, matching(root, "*"))):
        files = [_either(scene, name) for name in ("im2", "im6", "disp2", "disp6")]
        left, right, truth_left, truth_right = files
        if (left or right) and truth_left:  # One that is missing is said to be.
            yield FileFrame(
                name=scene.name,
                scene_name=scene.name,
                read_left=partial(read_picture, left or scene / "im2.png"),
                read_right=partial(read_picture, right or scene / "im6.png"),
                read_disparity_left=partial(read_disparity, truth_left),
                read_disparity_right=partial(read_disparity, truth_right) if truth_right else None,
            )


def _either(scene: Path, name: str) -> Path | None:
    paths = (scene / f"{name}{suffix}" for suffix in (".png", ".ppm", ".pgm"))
    return next((path for path in paths if path.is_file()), None)


FORMATS = (SourceFormat("middlebury2003", "Middlebury 2003", _recognises, _find),)

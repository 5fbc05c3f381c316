"""CREStereo's synthetic set (Li et al., CVPR 2022): `{tree,shapenet,reflective,hole}/*_left.jpg`, `*_right.jpg`,
`*_left.disp.png`, `*_right.disp.png`.

The disparities of both views are 16-bit PNG files with d = value / 32, valid everywhere. Occlusion is derived from
both. Every frame is a scene of its own; the four folders are kinds of scenes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats import read_png
from datagen.formats.picture import read_picture
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame
from stereoforge_kit.files import matching, walk_files

UNITS_PER_PX = 32
"""Of the 16-bit PNG files."""
_LEFT = "_left.disp.png"


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a CREStereo disparity: (H, W) float32 px. Raises FormatError for a file that is none."""
    values = read_png(path)
    if values.dtype != np.uint16 or values.ndim != 2:
        raise FormatError(f"{path}: a CREStereo disparity is a 16-bit grey PNG, not {values.dtype}")
    return values.astype(np.float32) / UNITS_PER_PX


def _recognises(root: Path) -> bool:
    return bool(matching(root, (f"*{_LEFT}", f"*/*{_LEFT}")))


def _find(root: str, split: str) -> Sequence[StereoFrame]:  # noqa: ARG001
    return FileFrames(_frames(Path(root)))


def _frames(root: Path) -> Iterator[FileFrame]:
    for truth in walk_files(root):
        if not truth.name.endswith(_LEFT):
            continue
        stem = truth.name.removesuffix(_LEFT)
        name = (truth.parent / stem).relative_to(root).as_posix()
        yield FileFrame(
            name=name,
            scene_name=name,
            read_left=partial(read_picture, truth.with_name(f"{stem}_left.jpg")),
            read_right=partial(read_picture, truth.with_name(f"{stem}_right.jpg")),
            read_disparity_left=partial(read_disparity, truth),
            read_disparity_right=partial(read_disparity, truth.with_name(f"{stem}_right.disp.png")),
        )


FORMATS = (SourceFormat("crestereo", "CREStereo", _recognises, _find),)

"""Middlebury 2005 and 2006 (Scharstein and Pal, CVPR 2007; Hirschmüller and Scharstein, CVPR 2007). Every scene has a
folder with `view1.png`, `view5.png`, `disp1.png`, `disp5.png`. Where a download has all lights and exposures, the
pictures are in its folders `Illum1/Exp0` and so on, which are frames of one scene.

The disparities of the left (1) and right (5) view have 8 bits. The grey value is the disparity in pixels of the full
size, so it is divided by 2 for the half and by 3 for the third size; grey 0 where there is none. The size is that of
the download's folder, `FullSize`, `HalfSize` or `ThirdSize`, or else follows from the picture's width. Occlusion is
derived from both.
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
from stereoforge_kit.files import matching

SIZES = {"fullsize": 1, "halfsize": 2, "thirdsize": 3}
"""Grey values per pixel of disparity, by the folder of the download in lower case."""
_SCALES = ((500, 3), (750, 2), (1500, 1))
"""(largest image width, grey values per pixel of disparity): the pictures are 1240 to 1396, 620 to 698 and 413 to 465
pixels wide."""
_SCENES = ("disp1.png", "*/disp1.png", "*/*/disp1.png")


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a disparity of the 2005 and 2006 sets: (H, W) float32 px, NaN where there is none.

    Raises FormatError for a file that is none.
    """
    values = read_png(path)
    if values.dtype != np.uint8 or values.ndim != 2:
        raise FormatError(f"{path}: a Middlebury 2005 or 2006 disparity is 8-bit grey, not {values.dtype}")
    disparity = values.astype(np.float32) / _scale(path, values.shape[1])
    disparity[values == 0] = np.nan
    return disparity


def _scale(path: Path, width: int) -> int:
    named = (SIZES[part.lower()] for part in reversed(path.parts) if part.lower() in SIZES)
    fitting = (scale for most, scale in _SCALES if width <= most)
    scale = next(named, None) or next(fitting, None)
    if scale is None:
        raise FormatError(
            f"{path}: is wider than the full size of the 2005 and 2006 sets, {_SCALES[-1][0]} pixels"
        )
    return scale


def _recognises(root: Path) -> bool:
    return any(True for _ in _frames(root))


def _find(root: str, split: str) -> Sequence[StereoFrame]:  # noqa: ARG001
    return FileFrames(_frames(Path(root)))


def _frames(root: Path) -> Iterator[FileFrame]:
    for truth in matching(root, _SCENES):
        scene, truth_right = truth.parent, truth.with_name("disp5.png")
        pictures = matching(scene, ("view[15].png", "Illum*/Exp*/view[15].png"))
        for folder in dict.fromkeys(picture.parent for picture in pictures):
            name = folder.relative_to(root).as_posix()
            yield FileFrame(
                name=scene.name if name == "." else name,
                scene_name=scene.name,
                read_left=partial(read_picture, folder / "view1.png"),
                read_right=partial(read_picture, folder / "view5.png"),
                read_disparity_left=partial(read_disparity, truth),
                read_disparity_right=partial(read_disparity, truth_right) if truth_right.is_file() else None,
            )


FORMATS = (SourceFormat("middlebury2006", "Middlebury 2005/2006", _recognises, _find),)

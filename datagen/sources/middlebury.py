"""Middlebury with floating-point disparities: the 2014 and 2021 scenes and the version 3 benchmark (Scharstein et al.,
GCPR 2014). Every scene has a folder with `im0.png`, `im1.png` and `disp0.pfm` (benchmark: `disp0GT.pfm`), often also
`disp1` and `mask0nocc.png`.

Disparities are in pixels, infinite where there is none. The mask is 255 where both views show the point. Without a mask
occlusion is derived from both disparities, if there are both. Pictures in other light, from other directions or at
other sizes (`Piano` and `PianoL`, `chess1` and `chess2`, `trainingQ` and `trainingF`) are of one scene.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import read_pfm_disparity, read_png
from datagen.formats.impossible_disparity import drop_impossible
from datagen.formats.picture import read_picture
from datagen.ground_truth.from_disparity import occlusion_from_mask
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame
from stereoforge_kit.files import matching

ETH3D_IMAGES = "two_view_training"
"""ETH3D's folder of images: its scenes are encoded as these are (`datagen.sources.eth3d`)."""
_SHOWN_BY_BOTH = 255
_VARIANT = re.compile(r"(?<=[a-z])\d?[ELP]?(-(im)?perfect)?$")
"""What tells pictures of one scene apart: the direction of view, the exposure, the light, the rectification."""
_DISPARITY_NAMES = ("disp{}GT.pfm", "disp{}.pfm", "disp{}GT.PFM", "disp{}.PFM")


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a Middlebury disparity: (H, W) float32 px, NaN where there is none.

    Raises FormatError for a file that is none.
    """
    disparity = read_pfm_disparity(path)
    disparity[np.isinf(disparity)] = np.nan
    return disparity


def read_labels(disparity_left: Path, mask: Path) -> NDArray[np.uint8]:
    """Occlusion labels (H, W) of the left view from its disparity and `mask0nocc.png`. Raises FormatError."""
    disparity, _ = drop_impossible(read_disparity(disparity_left))
    shown = read_png(mask)
    not_visible = ((shown if shown.ndim == 2 else shown[..., 0]) != _SHOWN_BY_BOTH) & ~np.isnan(disparity)
    return occlusion_from_mask(disparity, not_visible)


def scene_frame(name: str, scene_name: str, images: Path, ground_truth: Path) -> FileFrame | None:
    """The frame of a scene with these folders, or None if there is no ground truth."""
    left = _disparity_file(ground_truth, 0)
    if left is None:
        return None
    right, mask = _disparity_file(ground_truth, 1), ground_truth / "mask0nocc.png"
    return FileFrame(
        name=name,
        scene_name=scene_name,
        read_left=partial(read_picture, images / "im0.png"),
        read_right=partial(read_picture, images / "im1.png"),
        read_disparity_left=partial(read_disparity, left),
        read_disparity_right=None if right is None else partial(read_disparity, right),
        read_occlusion_left=partial(read_labels, left, mask) if mask.is_file() else None,
    )


def _disparity_file(folder: Path, view: int) -> Path | None:
    return next((path for name in _DISPARITY_NAMES if (path := folder / name.format(view)).is_file()), None)


def _recognises(root: Path) -> bool:
    return not (root / ETH3D_IMAGES).is_dir() and any(True for _ in _frames(root))


def _find(root: str, split: str) -> Sequence[StereoFrame]:  # noqa: ARG001
    return FileFrames(_frames(Path(root)))


def _frames(root: Path) -> Iterator[FileFrame]:
    # A scene that lacks one picture is a frame too, so that what it lacks is said.
    pictures = matching(root, ("im[01].png", "*/im[01].png", "*/*/im[01].png"))
    for folder in dict.fromkeys(picture.parent for picture in pictures):
        name = folder.relative_to(root).as_posix()
        scene_name = _VARIANT.sub("", folder.name)
        frame = scene_frame(folder.name if name == "." else name, scene_name, folder, folder)
        if frame is not None:
            yield frame


FORMATS = (SourceFormat("middlebury", "Middlebury", _recognises, _find),)

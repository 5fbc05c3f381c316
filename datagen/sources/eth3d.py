"""ETH3D two-view stereo (Schöps et al., CVPR 2017): `two_view_training/<scene>/im0.png, im1.png` and
`two_view_training_gt/<scene>/disp0GT.pfm, mask0nocc.png`. The ground truth may be beside the images too.

The encoding is Middlebury's: the disparity is infinite where there is none, and the mask is 255 where both views show
the point. Pairs of one place (`delivery_area_1l`, `delivery_area_3s`) are of one scene.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from datagen.sources.middlebury import ETH3D_IMAGES, scene_frame
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame
from stereoforge_kit.files import matching

_PAIR = re.compile(r"_\d+[ls]$")


def _recognises(root: Path) -> bool:
    return (root / ETH3D_IMAGES).is_dir()


def _find(root: str, split: str) -> Sequence[StereoFrame]:  # noqa: ARG001
    return FileFrames(_frames(Path(root)))


def _frames(root: Path) -> Iterator[FileFrame]:
    truths = root / f"{ETH3D_IMAGES}_gt"
    for scene in dict.fromkeys(picture.parent for picture in matching(root / ETH3D_IMAGES, "*/im[01].png")):
        beside = truths / scene.name
        place = _PAIR.sub("", scene.name)
        frame = scene_frame(scene.name, place, scene, beside if beside.is_dir() else scene)
        if frame is not None:
            yield frame


FORMATS = (SourceFormat("eth3d", "ETH3D two-view", _recognises, _find),)

"""FlyingThings3D, Driving and Monkaa (Mayer et al., CVPR 2016), as downloaded: `frames_cleanpass` or
`frames_finalpass` beside `disparity`.

The disparities of both views are PFM files in pixels. Most files are positive. Some are negative throughout (right
views of Driving, the subset for DispNet and FlowNet 2.0), so a file whose median is negative is negated. A value that
is still negative then, or larger than the image is wide, is an error of the set (FlyingThings3D has such frames) and
becomes NaN. Occlusion is derived from both disparities.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import read_pfm
from datagen.formats.picture import read_picture
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame

PASSES = {"clean": "frames_cleanpass", "final": "frames_finalpass"}
PARTS = {"train": "TRAIN", "test": "TEST"}
"""FlyingThings3D's own splits."""


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a SceneFlow disparity: (H, W) float32 px, positive, NaN where invalid.

    Raises FormatError for a file that is none.
    """
    disparity = read_pfm(path)
    if np.nanmedian(disparity) < 0:
        disparity = -disparity
    impossible = ~((disparity >= 0) & (disparity <= disparity.shape[1]))
    disparity[impossible] = np.nan
    return disparity


def _flying_things(root: Path) -> bool:
    return not (root / "recipe.yaml").is_file() and any(
        (root / folder / part).is_dir() for folder in PASSES.values() for part in PARTS.values()
    )


def _driving(root: Path) -> bool:
    return any(True for folder in PASSES.values() for _ in root.glob(f"{folder}/*mm_focallength/*/*/left"))


def _monkaa(root: Path) -> bool:
    return any(True for folder in PASSES.values() for _ in root.glob(f"{folder}/*/left"))


def _find(root: str, split: str, render_pass: str, pattern: str) -> Sequence[StereoFrame]:
    images = Path(root) / PASSES[render_pass]
    truths = Path(root) / "disparity"
    return FileFrames(_frames(images, truths, pattern.format(part=PARTS.get(split, ""))))


def _frames(images: Path, truths: Path, pattern: str) -> Iterator[FileFrame]:
    for truth in sorted(truths.glob(f"{pattern}/left/*.pfm")):
        scene = truth.parent.parent.relative_to(truths)
        yield FileFrame(
            name=f"{scene.as_posix()}/{truth.stem}",
            read_left=partial(read_picture, images / scene / "left" / f"{truth.stem}.png"),
            read_right=partial(read_picture, images / scene / "right" / f"{truth.stem}.png"),
            read_disparity_left=partial(read_disparity, truth),
            read_disparity_right=partial(read_disparity, truths / scene / "right" / truth.name),
        )


def _formats() -> Iterator[SourceFormat]:
    kinds = (
        ("flyingthings3d", "FlyingThings3D", _flying_things, "{part}/*/*", tuple(PARTS)),
        ("driving", "SceneFlow Driving", _driving, "*mm_focallength/*/*", ()),
        ("monkaa", "SceneFlow Monkaa", _monkaa, "*", ()),
    )
    for name, title, recognises, pattern, splits in kinds:
        yield SourceFormat(
            name, title, recognises, partial(_find, render_pass="clean", pattern=pattern), splits
        )
        yield SourceFormat(
            f"{name}-final",
            f"{title} (final pass)",
            lambda _: False,
            partial(_find, render_pass="final", pattern=pattern),
            splits,
        )


FORMATS = tuple(_formats())

"""FlyingThings3D, Driving and Monkaa (Mayer et al., CVPR 2016), as downloaded: `frames_cleanpass` or
`frames_finalpass` beside `disparity`.

The disparities of both views are PFM files in pixels. Most files are positive. Some are negative throughout (right
views of Driving, the subset for DispNet and FlowNet 2.0), so a file whose median is negative is negated. Values that
are still negative then, or larger than the image is wide, are errors of the set (FlyingThings3D has such frames), and
missing as in every set. Occlusion is derived from both disparities. The pictures are PNG files, or WebP files as they
can be downloaded too (`frames_cleanpass_webp`).

A scene of FlyingThings3D is a folder of frames. Driving is one street, seen with two lenses, in two directions and at
two speeds. Monkaa's folders show eight worlds, most of them more than once: `eating_x2` and `eating_camera2_x2`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import read_pfm_disparity
from datagen.formats.picture import read_picture
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame
from stereoforge_kit.files import matching

PASSES = {"clean": "frames_cleanpass", "final": "frames_finalpass"}
_IN_WEBP = "_webp"
"""What the folder of a pass's WebP pictures has behind its name."""
PARTS = {"train": "TRAIN", "test": "TEST"}
"""FlyingThings3D's own splits."""
_VARIANT = re.compile(r"(_(camera2|naked|augmented\d|difftex\d?|winter))*_x2$")
"""What tells Monkaa's folders of one world apart."""


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a SceneFlow disparity: (H, W) float32 px, positive. Raises FormatError for a file that is none."""
    disparity = read_pfm_disparity(path)
    known = disparity[np.isfinite(disparity)]
    return -disparity if known.size and np.median(known) < 0 else disparity


def _flying_things(root: Path, images: str) -> bool:
    return not (root / "recipe.yaml").is_file() and any(
        (root / images / part).is_dir() for part in PARTS.values()
    )


def _driving(root: Path, images: str) -> bool:
    return bool(matching(root, f"{images}/*mm_focallength/*/*/left"))


def _monkaa(root: Path, images: str) -> bool:
    return bool(matching(root, f"{images}/*/left"))


def recognises_pass(
    root: Path, passes: Mapping[str, str], render_pass: str, has_images: Callable[[Path, str], bool]
) -> bool:
    """Whether the folder has a pass's images; those of the final pass count where there are no clean ones."""
    found = [
        name
        for name, images in passes.items()
        if has_images(root, images) or has_images(root, f"{images}{_IN_WEBP}")
    ]
    return found[:1] == [render_pass]


def picture_file(folder: Path, stem: str) -> Path:
    """A picture's PNG file or, where there is none, its WebP file, also in the folders that the download has for those.

    `folder` is that of one view of a frame's pictures, such as `frames_cleanpass/TRAIN/A/0000/left`.
    """
    path = folder / f"{stem}.png"
    others = (path.with_suffix(".webp"), _webp_folder(path).with_suffix(".webp"))
    return path if path.is_file() else next((other for other in others if other.is_file()), path)


def _webp_folder(path: Path) -> Path:
    """The path below the pass's WebP folder."""
    names = {*PASSES.values(), "image_clean", "image_final"}
    return Path(*(f"{part}{_IN_WEBP}" if part in names else part for part in path.parts))


def _find(
    root: str, split: str, render_pass: str, pattern: str, scene_of: Callable[[str], str]
) -> Sequence[StereoFrame]:
    images = Path(root) / PASSES[render_pass]
    truths = Path(root) / "disparity"
    return FileFrames(_frames(images, truths, pattern.format(part=PARTS.get(split, "")), scene_of))


def _frames(images: Path, truths: Path, pattern: str, scene_of: Callable[[str], str]) -> Iterator[FileFrame]:
    for truth in matching(truths, f"{pattern}/left/*.[pP][fF][mM]"):
        scene = truth.parent.parent.relative_to(truths)
        yield FileFrame(
            name=f"{scene.as_posix()}/{truth.stem}",
            scene_name=scene_of(scene.as_posix()),
            read_left=partial(read_picture, picture_file(images / scene / "left", truth.stem)),
            read_right=partial(read_picture, picture_file(images / scene / "right", truth.stem)),
            read_disparity_left=partial(read_disparity, truth),
            read_disparity_right=partial(read_disparity, truths / scene / "right" / truth.name),
        )


def _formats() -> Iterator[SourceFormat]:
    kinds = (
        ("flyingthings3d", "FlyingThings3D", _flying_things, "{part}/*/*", str, tuple(PARTS)),
        ("driving", "SceneFlow Driving", _driving, "*mm_focallength/*/*", lambda _: "driving", ()),
        ("monkaa", "SceneFlow Monkaa", _monkaa, "*", lambda folder: _VARIANT.sub("", folder), ()),
    )
    for name, title, has_images, pattern, scene_of, splits in kinds:
        for render_pass in PASSES:
            final = render_pass == "final"
            yield SourceFormat(
                f"{name}-final" if final else name,
                f"{title} (final pass)" if final else title,
                partial(recognises_pass, passes=PASSES, render_pass=render_pass, has_images=has_images),
                partial(_find, render_pass=render_pass, pattern=pattern, scene_of=scene_of),
                splits,
            )


FORMATS = tuple(_formats())

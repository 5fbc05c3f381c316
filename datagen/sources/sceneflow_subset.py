"""FlyingThings3D's subset for DispNet and FlowNet 2.0 (Ilg et al., ECCV 2018), as downloaded: flat folders
`{train,val}/image_clean/{left,right}/0000000.png`, or `image_final`, beside `disparity/{left,right}/0000000.pfm`.

The disparities are those of the whole set, negative in most files (`datagen.sources.sceneflow`). The files' numbers do
not tell which scene a frame is of, so each is a scene of its own. Occlusion is derived from both disparities.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from datagen.formats.picture import read_picture
from datagen.sources.registry import SourceFormat
from datagen.sources.sceneflow import picture_file, read_disparity, recognises_pass
from datagen.sources.stereo_frame import FileFrame, FileFrames, StereoFrame
from stereoforge_kit.files import matching

PASSES = {"clean": "image_clean", "final": "image_final"}
SPLITS = ("train", "val")


def _has_images(root: Path, images: str) -> bool:
    return any((root / split / images / "left").is_dir() for split in SPLITS)


def _find(root: str, split: str, render_pass: str) -> Sequence[StereoFrame]:
    return FileFrames(_frames(Path(root) / split, PASSES[render_pass]))


def _frames(folder: Path, images: str) -> Iterator[FileFrame]:
    for truth in matching(folder / "disparity" / "left", "*.[pP][fF][mM]"):
        left, right = (picture_file(folder / images / view, truth.stem) for view in ("left", "right"))
        name = f"{folder.name}/{truth.stem}"
        yield FileFrame(
            name=name,
            scene_name=name,
            read_left=partial(read_picture, left),
            read_right=partial(read_picture, right),
            read_disparity_left=partial(read_disparity, truth),
            read_disparity_right=partial(read_disparity, folder / "disparity" / "right" / truth.name),
        )


FORMATS = tuple(
    SourceFormat(
        name,
        title,
        partial(recognises_pass, passes=PASSES, render_pass=render_pass, has_images=_has_images),
        partial(_find, render_pass=render_pass),
        SPLITS,
    )
    for name, title, render_pass in (
        ("flyingthings3d-subset", "FlyingThings3D's subset", "clean"),
        ("flyingthings3d-subset-final", "FlyingThings3D's subset (final pass)", "final"),
    )
)

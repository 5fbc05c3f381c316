"""The paths of a data set: the tree of FlyingThings3D (Mayer et al., CVPR 2016), and more beside it.

    recipe.yaml
    assets.json                                     the list of the user assets, if there are any
    frames_cleanpass/TRAIN/A/0003/left/0006.png     one file for each view and frame
    camera_data/TRAIN/A/0003/camera_data.txt        one file for each scene
    camera_data/TRAIN/A/0003/cameras.json           one file for each scene
    scenes/TRAIN/A/0003.json                        the Scene record
    manifest/TRAIN/A/0003.json                      written last: a scene exists if its manifest does

Frames are numbered from `FIRST_FRAME`, as in FlyingThings3D; that file shows the scene at the instant t = 0.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from datagen.errors import DatasetError
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import LocalTree, Tree

SPLITS = ("train", "val", "test")
"""Splits never share a scene, a mesh or a texture."""
SceneKey = tuple[str, int]
"""A scene of a data set: (split, number)."""
View = Literal["left", "right"]
VIEWS: tuple[View, View] = ("left", "right")
"""The two views of a stereo pair."""
Direction = Literal["into_future", "into_past"]
DIRECTIONS: tuple[Direction, Direction] = ("into_future", "into_past")
"""To the instant one frame later, and one frame earlier."""

FIRST_FRAME = 6
"""Number of the first frame on disk, as in FlyingThings3D."""
LETTER = "A"
"""FlyingThings3D groups its scenes in A, B and C; all of ours are in the first group."""


@dataclass(frozen=True)
class Kind:
    """One kind of data file: the top folder that holds the files, and how they are named."""

    folder: str
    extension: str
    per_view: bool = True
    """Whether there is a file for each view and frame. Otherwise there is one for each scene, named after the kind."""
    over_time: bool = False
    """Whether there is a file for each direction of time, view and frame."""
    own_name: str | None = None
    """The kind's name, if it shares another kind's folder."""

    @property
    def name(self) -> str:
        """What the kind is called; that of its folder, unless that is another kind's."""
        return self.own_name or self.folder

    @property
    def directions(self) -> tuple[Direction | None, ...]:
        """The directions that `Layout.file` takes for this kind."""
        return DIRECTIONS if self.over_time else (None,)


KINDS = {
    kind.name: kind
    for kind in (
        Kind("frames_cleanpass", ".png"),
        Kind("frames_finalpass", ".png"),
        Kind("disparity", ".pfm"),
        Kind("disparity_gradient", ".exr"),
        Kind("occlusion", ".png"),
        Kind("object_index", ".png"),
        Kind("material_index", ".png"),
        Kind("depth", ".exr"),
        Kind("reflective", ".png"),
        Kind("normals", ".exr"),
        Kind("optical_flow", ".pfm", over_time=True),
        Kind("disparity_change", ".pfm", over_time=True),
        Kind("motion_boundaries", ".pgm", over_time=True),
        Kind("camera_data", ".txt", per_view=False),
        Kind("camera_data", ".json", per_view=False, own_name="cameras"),
    )
}
"""Every kind of data file by its name."""
FOLDERS = tuple(dict.fromkeys(kind.folder for kind in KINDS.values()))
"""The top folders of all kinds."""
TARGETS = ("disparity", "disparity_gradient", "occlusion", "object_index", "camera_data", "cameras")
"""The kinds that every scene has, whichever passes were rendered."""
EXTRA_TARGETS = (
    "depth",
    "material_index",
    "reflective",
    "normals",
    "optical_flow",
    "disparity_change",
    "motion_boundaries",
)
"""The kinds that a recipe may ask for besides."""
ENGINES = ("cycles", "workbench")
"""What may make the pictures: Cycles, which follows light, or Workbench, which draws drafts."""
RENDER_PASSES = {"clean": "frames_cleanpass", "final": "frames_finalpass"}
"""The kind of picture file by the name of the render pass."""

_RECORD_NAME = re.compile(r"(\d{4}|[1-9]\d{4,})\.json")


@dataclass(frozen=True)
class Layout:
    """The paths of a data set under its root folder; only `local` and `committed_scenes` touch the disk."""

    root: Path

    def scene_folder(self, kind: str, split: str, scene: int) -> Path:
        """The folder of one kind of file of one scene, for example root/disparity/TRAIN/A/0003."""
        return self._group(KINDS[kind].folder, split) / _number(scene)

    def file(
        self,
        kind: str,
        split: str,
        scene: int,
        view: str | None = None,
        frame: int | None = None,
        direction: Direction | None = None,
    ) -> Path:
        """The path of a data file.

        Args:
            kind: One of `KINDS`.
            split: "train", "val" or "test".
            scene: The scene's number, from 0.
            view: "left" or "right", for kinds with a file for each view.
            frame: The frame's number on disk, `FIRST_FRAME` + t, for these kinds too.
            direction: "into_future" or "into_past", for kinds over time.

        Raises:
            ValueError: If view, frame and direction do not fit the kind.
            DatasetError: If there is no such split.
        """
        entry, folder = KINDS[kind], self.scene_folder(kind, split, scene)
        if not entry.per_view:
            return folder / f"{entry.name}{entry.extension}"
        if view not in VIEWS or frame is None or frame < FIRST_FRAME:
            raise InputError(
                f"a file of {kind} needs a view, left or right, and a frame from {FIRST_FRAME} up, "
                f"got {view!r} and {frame}"
            )
        if direction not in entry.directions:
            raise InputError(f"a file of {kind} has no direction {direction!r}")
        name = _number(frame)
        if kind == "optical_flow":
            towards = "IntoFuture" if direction == "into_future" else "IntoPast"
            name = f"OpticalFlow{towards}_{name}_{view[0].upper()}"
        return folder / (direction or "") / view / f"{name}{entry.extension}"

    def scene_record(self, split: str, scene: int) -> Path:
        """The path of the Scene record, the world that was rendered."""
        return self._group("scenes", split) / f"{_number(scene)}.json"

    def manifest(self, split: str, scene: int) -> Path:
        """The path of the scene's manifest."""
        return self._group("manifest", split) / f"{_number(scene)}.json"

    def scene_paths(self, split: str, scene: int) -> list[Path]:
        """All paths that a scene consists of: its folders, then its record, its manifest last."""
        folders = [self._group(folder, split) / _number(scene) for folder in FOLDERS]
        return [*folders, self.scene_record(split, scene), self.manifest(split, scene)]

    @property
    def assets(self) -> Path:
        """The folder of the prepared user assets (`datagen.recipe.assets`)."""
        return self.root / "assets"

    @property
    def asset_pool(self) -> Path:
        """The path of the list of the user assets, which the recipe names by its SHA-256."""
        return self.root / "assets.json"

    @property
    def recipe(self) -> Path:
        """The path of the recipe that the data set was rendered from."""
        return self.root / "recipe.yaml"

    @property
    def tree(self) -> Tree:
        """The folder or URL that the files are in."""
        return LocalTree(self.root)

    def local(self, path: Path) -> Path:
        """The path of a file on this machine; a remote cache fetches the file first."""
        return path

    def committed_scenes(self, split: str) -> list[int]:
        """The numbers of the finished scenes, ascending: those that have a manifest."""
        return scene_numbers(self.tree.files_in(self.relative(self._group("manifest", split))))

    def relative(self, path: Path) -> str:
        """A path below the root as manifests write it: relative, with forward slashes."""
        return path.relative_to(self.root).as_posix()

    def _group(self, folder: str, split: str) -> Path:
        if split not in SPLITS:
            raise DatasetError(f"{self.root}: there is no split {split!r}; there are {', '.join(SPLITS)}")
        return self.root / folder / split.upper() / LETTER


def scene_numbers(names: Iterable[str]) -> list[int]:
    """The numbers of the scenes whose records or manifests have these file names, ascending.

    Other names are left out.
    """
    matches = (_RECORD_NAME.fullmatch(name) for name in names)
    return sorted(int(match[1]) for match in matches if match)


def _number(value: int) -> str:
    if value < 0:
        raise InputError(f"scenes and frames are numbered from 0, got {value}")
    return f"{value:04d}"

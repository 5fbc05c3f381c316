"""All checks of one finished scene: of its manifest, files, Scene record and frames."""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from datagen.dataset.integrity import compare
from datagen.dataset.layout import FIRST_FRAME, KINDS, RENDER_PASSES, TARGETS, VIEWS, Layout
from datagen.dataset.manifest import FileEntry, SceneManifest, read_manifest
from datagen.dataset.samples import StereoSample, read_scene
from datagen.errors import DatasetError
from datagen.formats import cameras_record, read_camera_data, read_cameras
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.recipe.recipe import Recipe
from datagen.verify.frame_check import FrameCheck
from datagen.verify.report import Problem
from scenes import Scene
from scenes.user_assets.pool import UserMesh
from stereoforge_kit.errors import InputError

SAMPLED_PIXELS = 500
"""Number of random pixels of each view that are compared with the scene's geometry by default."""
FORBIDDEN = os.strerror(errno.EACCES)
POSE_TOLERANCE = 1e-9
"""How far an element of a pose may be from the scene's."""


@dataclass
class SceneCheck:
    """The check of one scene. `run` collects the problems and never raises for damaged data."""

    layout: Layout
    recipe: Recipe
    split: str
    scene: int
    sampled_pixels: int = SAMPLED_PIXELS
    problems: list[Problem] = field(default_factory=list)
    known: set[str] = field(default_factory=set)
    """The paths of the scene's files, relative to the root."""
    frames: int = 0
    files: int = 0
    bytes_read: int = 0
    _whole: set[str] = field(default_factory=set)
    """The paths of the files that are intact."""

    def run(self) -> SceneCheck:
        """Check the scene; return this object with its problems and counts."""
        path = self.layout.manifest(self.split, self.scene)
        self.known.add(self.layout.relative(path))
        try:
            manifest = read_manifest(self.layout.local(path))
        except DatasetError as error:
            self._failed(error)
            return self
        self._check_head(path, manifest)
        self.known.update(entry.path for entry in manifest.files)
        self._whole.update(entry.path for entry in manifest.files if self._is_whole(entry))
        record = self.layout.scene_record(self.split, self.scene)
        if self._are_readable([record]):
            try:
                scene = read_scene(record)
            except DatasetError as error:
                self._failed(error)
            else:
                self._check_contents(scene, self._caster(scene))
        return self

    def could_not_run(self, sentence: str) -> None:
        """Record that the process that ran this check failed."""
        record = self.layout.scene_record(self.split, self.scene)
        self._found(record, f"could not be checked: {sentence}", unchecked=True)

    def _caster(self, scene: Scene) -> SceneRayCaster | None:
        """What casts rays at the scene; None if that is not asked for, or not possible: a user's mesh is missing."""
        if not self.sampled_pixels:
            return None
        try:
            for shape in (thing.shape for thing in scene.objects):
                if isinstance(shape, UserMesh):
                    self.layout.local(self.layout.assets / f"{shape.sha256}.npz")
            return SceneRayCaster(build_geometry(scene))
        except InputError as error:
            record = self.layout.scene_record(self.split, self.scene)
            self._found(record, f"its geometry could not be checked: {error}", unchecked=True)
            return None

    def _found(self, path: Path, message: str, unchecked: bool = False) -> None:
        self.problems.append(Problem(self.layout.relative(path), message, self.split, self.scene, unchecked))

    def _failed(self, error: ValueError) -> None:
        """Record a reader's error; its message begins with the file's whole path."""
        place, _, message = str(error).removeprefix(f"{self.layout.root}/").partition(": ")
        self.problems.append(Problem(place, message, self.split, self.scene))

    def _check_head(self, path: Path, manifest: SceneManifest) -> None:
        if (manifest.split, manifest.scene) != (self.split, self.scene):
            self._found(path, f"is the manifest of {manifest.split} scene {manifest.scene}")
        if manifest.recipe_sha256 != self.recipe.settings_sha256():
            self._found(path, "was rendered with other settings than the recipe's")

    def _is_whole(self, entry: FileEntry) -> bool:
        """Whether a file is as its entry in the manifest says."""
        size, problem = compare(self.layout, entry)
        self.files += 1
        self.bytes_read += size
        if problem:
            # Bytes that nobody may read, or that a store does not hand out now, may well be right.
            self._found(self.layout.root / entry.path, problem, unchecked=problem.endswith(FORBIDDEN))
        return problem is None

    def _are_readable(self, paths: list[Path]) -> bool:
        """Whether files that the scene must have are intact. A file that the manifest does not list is a problem."""
        names = [self.layout.relative(path) for path in paths]
        for path, name in zip(paths, names, strict=True):
            if name not in self.known:
                self._found(path, "is part of the scene but not in its manifest")
        return self._whole.issuperset(names)

    def _check_contents(self, scene: Scene, caster: SceneRayCaster | None) -> None:
        camera_data = self.layout.file("camera_data", self.split, self.scene)
        if self._are_readable([camera_data]):
            self._check_camera_data(camera_data, scene)
        cameras = self.layout.file("cameras", self.split, self.scene)
        if self._are_readable([cameras]):
            self._check_cameras(cameras, scene)
        for instant in range(scene.frames):
            self.frames += 1
            if self._are_readable(self._frame_files(FIRST_FRAME + instant)):
                self._check_frame(scene, caster, FIRST_FRAME + instant)

    def _frame_files(self, frame: int) -> list[Path]:
        kinds = [RENDER_PASSES[name] for name in self.recipe.passes]
        kinds += [kind for kind in (*TARGETS, *self.recipe.targets) if KINDS[kind].per_view]
        return [
            self.layout.file(kind, self.split, self.scene, view, frame, direction)
            for kind in kinds
            for view in VIEWS
            for direction in KINDS[kind].directions
        ]

    def _check_frame(self, scene: Scene, caster: SceneRayCaster | None, frame: int) -> None:
        samples = tuple(
            StereoSample(self.layout, self.split, self.scene, frame, name) for name in self.recipe.passes
        )
        try:
            for path, message in FrameCheck(
                samples, self.recipe, scene, caster, self.sampled_pixels
            ).problems():
                self._found(path, message)
        except DatasetError as error:
            self._failed(error)

    def _check_cameras(self, path: Path, scene: Scene) -> None:
        """Check that the intrinsics and poses on disk are those of the scene's camera."""
        try:
            found = read_cameras(path)
        except DatasetError as error:
            self._failed(error)
            return
        expected = cameras_record(scene.camera, {FIRST_FRAME + k: float(k) for k in range(scene.frames)})
        if not _is_near(found, expected):
            self._found(path, "its numbers are not those of the scene's camera")

    def _check_camera_data(self, path: Path, scene: Scene) -> None:
        """Check that the poses on disk are those of the scene's camera."""
        try:
            poses = read_camera_data(path)
        except DatasetError as error:
            self._failed(error)
            return
        camera = scene.camera
        expected = {FIRST_FRAME + k: [camera.pose(view, k) for view in VIEWS] for k in range(scene.frames)}
        if poses.keys() != expected.keys():
            self._found(path, f"has the frames {sorted(poses)} where the scene has {sorted(expected)}")
            return
        for frame, matrices in poses.items():
            if not np.allclose(matrices, expected[frame], rtol=0, atol=POSE_TOLERANCE):
                self._found(path, f"the poses of frame {frame} are not those of the scene's camera")


def _is_near(found: Any, expected: Any) -> bool:
    """Whether two JSON values are alike but for the last digits of their numbers."""
    if isinstance(expected, dict):
        return (
            isinstance(found, dict)
            and found.keys() == expected.keys()
            and all(_is_near(found[key], value) for key, value in expected.items())
        )
    try:
        one, two = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    except (TypeError, ValueError):
        return False
    return one.shape == two.shape and np.allclose(one, two, rtol=POSE_TOLERANCE, atol=POSE_TOLERANCE)

"""Estimating the time and disk that rendering a recipe would take, by measuring one frame of one scene."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from datagen.dataset.layout import KINDS, SPLITS, Layout
from datagen.dataset.manifest import SceneManifest, read_manifest
from datagen.errors import DatasetError
from datagen.recipe.recipe import Recipe, fit_disparities
from datagen.rendering.run import committed_scenes, render_dataset
from stereoforge_kit.files import open_tree, temporary_folder

ONCE_A_SCENE = ("sample", "build")
"""The steps of a scene whose time does not depend on the number of frames."""


@dataclass(frozen=True)
class Estimate:
    """What the missing scenes would take. Times are for this machine with all its cores at work."""

    missing: dict[str, int]
    """Number of missing scenes by split."""
    already_there: int
    """Number of scenes that are finished."""
    frames: int
    """Stereo pairs to render, in each pass."""
    scene_seconds: float
    scene_bytes: float

    @property
    def seconds(self) -> float:
        """For all missing scenes."""
        return sum(self.missing.values()) * self.scene_seconds

    @property
    def bytes(self) -> float:
        """For all missing scenes."""
        return sum(self.missing.values()) * self.scene_bytes


def estimate_run(
    recipe: Recipe, root: Path | str, *, device: str = "cpu", shard: tuple[int, int] = (0, 1)
) -> Estimate:
    """Count the missing scenes of a recipe under `root`, and render one frame elsewhere to measure it.

    Scenes are alike only on average, so the time is good to a factor of two. Nothing is written under `root`.

    Args:
        recipe: What to render.
        root: A folder or a URL, which need not exist.
        device: What Cycles computes on.
        shard: (i, n) counts only every n-th scene from the i-th.

    Raises:
        DatasetError: If that frame cannot be rendered.
    """
    committed = committed_scenes(open_tree(root))
    wanted = {split: set(range(shard[0], count, shard[1])) for split, count in recipe.scenes.items()}
    there = {split: {scene for where, scene in committed if where == split} for split in SPLITS}
    missing = {split: len(numbers - there[split]) for split, numbers in wanted.items()}
    already = sum(len(numbers & there[split]) for split, numbers in wanted.items())
    frames = recipe.world.frames * sum(missing.values())
    if not frames:
        return Estimate(missing, already, 0, 0.0, 0.0)
    split = next(split for split, count in missing.items() if count)
    manifest = _measured(fit_disparities(recipe), root, split, device)
    steps = manifest.seconds
    once = sum(steps[name] for name in ONCE_A_SCENE)
    seconds = once + recipe.world.frames * (sum(steps.values()) - once)
    per_frame, per_scene = _sizes(manifest)
    return Estimate(missing, already, frames, seconds, per_scene + recipe.world.frames * per_frame)


def _measured(recipe: Recipe, root: Path | str, split: str, device: str) -> SceneManifest:
    """The manifest of the split's first scene, rendered with one frame and as full as after a curriculum."""
    world = replace(recipe.world, frames=1)
    one = replace(recipe, world=world, scenes={split: 1}, curriculum_scenes=0)
    with temporary_folder() as folder:
        if recipe.assets:
            render_dataset(replace(one, scenes={}), folder / "set")
            Layout(folder / "set").assets.symlink_to(Layout(Path(root)).assets.resolve())
        summary = render_dataset(one, folder / "set", workers=1, device=device)
        if summary.failures:
            raise DatasetError(f"the scene to measure could not be rendered: {summary.failures[0].reason}")
        return read_manifest(Layout(folder / "set").manifest(split, 0))


def _sizes(manifest: SceneManifest) -> tuple[int, int]:
    """Bytes for each frame, and bytes for each scene besides."""
    sizes = [(PurePosixPath(entry.path).parts[0], entry.size) for entry in manifest.files]
    return _sum(sizes, True), _sum(sizes, False)


def _sum(sizes: Iterable[tuple[str, int]], per_frame: bool) -> int:
    return sum(size for kind, size in sizes if (kind in KINDS and KINDS[kind].per_view) == per_frame)

"""Is a data set what its manifests, its recipe and its scenes say? Every file, every frame, no Blender."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from datagen.dataset import open_layout
from datagen.layout import KINDS, SPLITS, Layout
from datagen.recipe import Recipe, read_recipe
from datagen.scene_check import Problem, SceneCheck


@dataclass(frozen=True)
class VerifyReport:
    """What was looked at and what was found."""

    root: Path
    scenes: int
    frames: int
    files: int
    bytes_read: int
    seconds: float
    problems: tuple[Problem, ...]

    @property
    def ok(self) -> bool:
        return not self.problems

    @property
    def megabytes_per_second(self) -> float:
        return self.bytes_read / 1e6 / self.seconds if self.seconds else 0.0

    def __str__(self) -> str:
        found = f"{len(self.problems)} problems" if self.problems else "no problem"
        return (
            f"{self.root}: {found} in {self.scenes} scenes, {self.frames} frames, {self.files} files, "
            f"{self.bytes_read / 1e6:.1f} MB read in {self.seconds:.1f} s "
            f"({self.megabytes_per_second:.0f} MB/s)"
        )


def verify_dataset(
    root: Path | str, progress: Callable[[int, int], None] | None = None, workers: int = 2
) -> VerifyReport:
    """Check every file and every frame of a data set.

    Files: size and SHA-256 as in the manifest, none missing, none that belongs to nothing. Arrays: they
    decode, have the camera's size and are finite; gradients, occlusion, object index and the two views'
    disparities agree. Geometry: poses are the scene's, and `SAMPLED_PIXELS` random pixels of each view agree
    with rays cast at the scene's meshes.

    Args:
        root: The data set's folder.
        progress: Called after each scene with (scenes done, scenes in all).
        workers: Threads; reading, hashing, decoding and array arithmetic run beside each other.

    Raises:
        DatasetError: For a folder that is missing or no data set at all, or a recipe that cannot be read.
    """
    start = time.perf_counter()
    layout = open_layout(root)
    recipe = read_recipe(layout.recipe)
    scenes = [(split, scene) for split in SPLITS for scene in layout.committed_scenes(split)]
    results = []
    with ThreadPoolExecutor(workers) as pool:
        for result in pool.map(lambda one: SceneCheck(layout, recipe, *one).run(), scenes):
            results.append(result)
            if progress is not None:
                progress(len(results), len(scenes))
    problems = [problem for result in results for problem in result.problems]
    problems += _unfinished(layout, recipe)
    problems += _orphans(layout, (result.known for result in results))
    return VerifyReport(
        root=layout.root,
        scenes=len(scenes),
        frames=sum(result.frames for result in results),
        files=sum(result.files for result in results),
        bytes_read=sum(result.bytes_read for result in results),
        seconds=time.perf_counter() - start,
        problems=tuple(problems),
    )


def _unfinished(layout: Layout, recipe: Recipe) -> Iterator[Problem]:
    """Scenes that the recipe promises and that have no manifest."""
    for split, count in recipe.scenes.items():
        missing = sorted(set(range(count)) - set(layout.committed_scenes(split)))
        if missing:
            numbers = ", ".join(map(str, missing[:10])) + (", ..." if len(missing) > 10 else "")
            message = f"{len(missing)} of the recipe's {count} {split} scenes are not finished ({numbers})"
            yield Problem(layout.recipe.name, message, split)


def _orphans(layout: Layout, known_by_scene: Iterable[set[str]]) -> Iterator[Problem]:
    """Files in the data set's folders that belong to no finished scene."""
    known = set().union(*known_by_scene)
    for folder in (*KINDS, "scenes", "manifest"):
        for path in sorted((layout.root / folder).rglob("*")):
            name = layout.relative(path)
            if not path.is_dir() and name not in known:
                yield Problem(name, "belongs to no finished scene")

"""Is a data set what its manifests, its recipe and its scenes say? Every file, every frame, no Blender."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from datagen.dataset import open_layout
from datagen.layout import KINDS, SPLITS, Layout
from datagen.recipe import Recipe, read_recipe
from datagen.scene_check import SAMPLED_PIXELS, Problem, SceneCheck

FEW_SCENES = 8
"""Fewer scenes than this are checked before other processes would have started."""


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
    root: Path | str,
    progress: Callable[[int, int], None] | None = None,
    *,
    workers: int | None = None,
    sampled_pixels: int = SAMPLED_PIXELS,
) -> VerifyReport:
    """Check every file and every frame of a data set.

    Files: size and SHA-256 as in the manifest, none missing, none that belongs to nothing. Arrays: they
    decode, have the camera's size and are finite; gradients, occlusion, object index and the two views'
    disparities agree. Geometry: poses are the scene's, and `sampled_pixels` random pixels of each view agree
    with rays cast at the scene's meshes.

    Args:
        root: The data set's folder.
        progress: Called after each scene with (scenes done, scenes in all).
        workers: Processes, one a core if None. Sets of under `FEW_SCENES` are checked in this process.
        sampled_pixels: Of each view, for the rays; 0 leaves the geometry out, which is most of the time.

    Raises:
        DatasetError: For a folder that is missing or no data set at all, or a recipe that cannot be read.
    """
    start = time.perf_counter()
    layout = open_layout(root)
    recipe = read_recipe(layout.recipe)
    checks = [
        SceneCheck(layout, recipe, split, scene, sampled_pixels)
        for split in SPLITS
        for scene in layout.committed_scenes(split)
    ]
    results = []
    for result in _run(checks, workers):
        results.append(result)
        if progress is not None:
            progress(len(results), len(checks))
    problems = [problem for result in results for problem in result.problems]
    problems += _unfinished(layout, recipe)
    problems += _orphans(layout, (result.known for result in results))
    return VerifyReport(
        root=layout.root,
        scenes=len(results),
        frames=sum(result.frames for result in results),
        files=sum(result.files for result in results),
        bytes_read=sum(result.bytes_read for result in results),
        seconds=time.perf_counter() - start,
        problems=tuple(problems),
    )


def _run(checks: list[SceneCheck], workers: int | None) -> Iterator[SceneCheck]:
    """Run the checks, in order, on as many processes as are worth starting."""
    workers = len(os.sched_getaffinity(0)) if workers is None else workers
    if workers == 1 or len(checks) < FEW_SCENES:
        yield from map(SceneCheck.run, checks)
        return
    # A fresh interpreter each: forking a process with threads of OpenCV or Embree in it can hang.
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(SceneCheck.run, checks)


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

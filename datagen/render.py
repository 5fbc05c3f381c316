"""Rendering a data set: which scenes are missing, workers to make them, and what came of it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from datagen.errors import DatasetError
from datagen.executors import Executor, LocalExecutor
from datagen.layout import Layout
from datagen.manifest import SceneManifest
from datagen.recipe import Recipe, merge_into, read_recipe, write_recipe
from datagen.scene_job import STAGING_FOLDER, SceneJob, render_scene


@dataclass(frozen=True)
class RenderSummary:
    """What a run of `render_dataset` did."""

    recipe: Recipe
    """The folder's recipe after the run."""
    rendered: int
    already_there: int
    failures: tuple[tuple[str, str], ...]
    """(scene, one sentence) for every scene that could not be rendered."""


def render_dataset(
    recipe: Recipe,
    root: Path | str,
    *,
    workers: int | None = None,
    device: str = "cpu",
    shard: tuple[int, int] = (0, 1),
    executor: Executor | None = None,
    on_scene: Callable[[int, int, SceneManifest | None], None] | None = None,
) -> RenderSummary:
    """Render what is missing of a recipe under `root`; running it again finishes or extends the data set.

    workers: processes, default one a core. shard: (i, n) renders only every n-th scene from the i-th, so that
    n machines can share a folder. on_scene: called with (done, total, manifest or None if it failed).

    Raises DatasetError if the folder holds something else: other files, or a data set of other settings.
    """
    root = Path(root)
    recipe = _claim(root, recipe)
    cores = len(os.sched_getaffinity(0))
    workers = cores if workers is None else workers
    threads = max(1, cores // workers)
    wanted = list(_wanted(recipe, shard))
    missing = [job for job in wanted if not Layout(root).manifest(*job).is_file()]
    jobs = [SceneJob(root, recipe, split, scene, device, threads) for split, scene in missing]
    executor = executor or LocalExecutor(workers=min(workers, max(1, len(jobs))))
    failures: list[tuple[str, str]] = []
    with closing(executor.run(render_scene, jobs)) as outcomes:
        for done, outcome in enumerate(outcomes, start=1):
            if outcome.error is not None:
                failures.append((outcome.job.name, outcome.error))
            if on_scene:
                on_scene(done, len(jobs), outcome.result)
    with suppress(OSError):  # another shard may still be using it
        (root / STAGING_FOLDER).rmdir()
    return RenderSummary(recipe, len(jobs) - len(failures), len(wanted) - len(jobs), tuple(failures))


def _claim(root: Path, recipe: Recipe) -> Recipe:
    """Write the recipe into a new folder, or extend the one that is there."""
    path = Layout(root).recipe
    if path.exists():
        merged = merge_into(read_recipe(path), recipe, root)
    elif root.is_dir() and any(root.iterdir()):
        raise DatasetError(f"{root} is neither empty nor a data set; give a new or empty folder")
    else:
        merged = recipe
    write_recipe(path, merged)
    return replace(merged, scenes=recipe.scenes)


def _wanted(recipe: Recipe, shard: tuple[int, int]) -> Iterator[tuple[str, int]]:
    index, count = shard
    if not 0 <= index < count:
        raise DatasetError(f"shard {index}/{count} does not exist: it takes 0 <= I < N")
    for split, scenes in recipe.scenes.items():
        for scene in range(index, scenes, count):
            yield split, scene

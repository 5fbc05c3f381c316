"""Checking a whole data set against its manifests, its recipe and its scenes, without Blender."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path

from datagen.dataset.layout import FOLDERS, SPLITS, Layout, SceneKey
from datagen.dataset.remote_cache import RemoteLayout
from datagen.dataset.samples import opened_layout
from datagen.errors import MachineError
from datagen.recipe.recipe import Recipe, read_recipe, recipe_to_text
from datagen.rendering.card import CARD, is_of_these_scenes
from datagen.rendering.quarantine import quarantined_scenes
from datagen.rendering.run import local_executor
from datagen.verify.report import Problem, VerifyReport
from datagen.verify.scene_check import SAMPLED_PIXELS, SceneCheck
from datagen.verify.shard_check import has_shards, verify_shards
from stereoforge_kit.files import open_tree

FEW_SCENES = 8
"""Fewer scenes than this are checked in this process: others would take longer to start."""
CHECK_TIMEOUT_S = 600.0
"""How long the check of one scene may take."""


def verify_dataset(
    root: Path | str,
    progress: Callable[[int, int], None] | None = None,
    *,
    workers: int | None = None,
    sampled_pixels: int = SAMPLED_PIXELS,
    only: Collection[SceneKey] | None = None,
) -> VerifyReport:
    """Check every file and every frame of a data set, or every file of shards exported from one.

    Files have the size and SHA-256 of the manifest; none is missing, and none belongs to no scene. Arrays decode,
    have the camera's size and are finite; gradients, occlusion, object index and the two views' disparities agree.
    Poses are those of the scene, and `sampled_pixels` random pixels of each view agree with rays cast at its meshes.

    Args:
        root: The data set's folder, or a URL.
        progress: Called after each scene with (scenes done, scenes in all).
        workers: Worker processes, with limits of time and memory; None for one per core, or for this process alone
            if there are fewer scenes than `FEW_SCENES`.
        sampled_pixels: Number of rays for each view; 0 leaves out the geometry, which takes most of the time.
        only: Check these (split, number) and nothing else.

    Raises:
        DatasetError: For a folder that is missing or no data set at all, or a recipe or index that cannot be read.
    """
    start = time.perf_counter()
    tree = open_tree(root)
    if has_shards(tree):
        return verify_shards(tree, progress, workers=workers)
    with opened_layout(root) as layout:
        recipe = read_recipe(layout.recipe)
        checks = [
            SceneCheck(layout, recipe, split, scene, sampled_pixels)
            for split in SPLITS
            for scene in layout.committed_scenes(split)
            if only is None or (split, scene) in only
        ]
        results: list[SceneCheck] = []
        for result in _run(checks, workers):
            results.append(result)
            if progress is not None:
                progress(len(results), len(checks))
        results.sort(key=lambda result: (SPLITS.index(result.split), result.scene))
        problems = [problem for result in results for problem in result.problems]
        if only is None:
            problems += _recipe_problems(layout, recipe)
            problems += _unfinished(layout, recipe)
            problems += _orphans(layout, (result.known for result in results))
            if not is_of_these_scenes(layout, recipe):
                problems.append(
                    Problem(CARD, "is the card of other scenes; stereoforge render writes it anew")
                )
    return VerifyReport(
        root=layout.tree.name,
        scenes=len(results),
        frames=sum(result.frames for result in results),
        files=sum(result.files for result in results),
        bytes_read=sum(result.bytes_read for result in results),
        seconds=time.perf_counter() - start,
        problems=tuple(problems),
    )


def _run(checks: list[SceneCheck], workers: int | None) -> Iterator[SceneCheck]:
    """Run the checks and yield them as they end, in worker processes if those are asked for or worth starting."""
    if workers is None and len(checks) < FEW_SCENES:
        yield from map(_check, checks)
        return
    # An untrusted Scene record can ask for any mesh: the time and memory to build it are limited.
    executor = local_executor(workers, timeout_s=CHECK_TIMEOUT_S)
    with closing(executor.run(_check, checks)) as outcomes:
        for outcome in outcomes:
            if outcome.failure is None:
                assert outcome.result is not None
                yield outcome.result
            else:
                if outcome.failure.kind == "environment":
                    raise MachineError(f"checking stopped: {outcome.failure.sentence}")
                outcome.job.could_not_run(outcome.failure.sentence)
                yield outcome.job


def _check(check: SceneCheck) -> SceneCheck:
    result = check.run()
    if isinstance(check.layout, RemoteLayout):
        check.layout.forget(check.split, check.scene)
    return result


def _recipe_problems(layout: Layout, recipe: Recipe) -> Iterator[Problem]:
    """The recipe is byte for byte what was written, and has all finished scenes."""
    name = layout.recipe.name
    if layout.recipe.read_bytes() != recipe_to_text(recipe).encode():
        yield Problem(name, "is not as it was written")
    for split in SPLITS:
        count = recipe.scenes.get(split, 0)
        beyond = [scene for scene in layout.committed_scenes(split) if scene >= count]
        if beyond:
            yield Problem(name, f"has {count} {split} scenes, but there is scene {beyond[-1]}", split)


def _unfinished(layout: Layout, recipe: Recipe) -> Iterator[Problem]:
    """The scenes of the recipe that are not finished."""
    for split, count in recipe.scenes.items():
        there = set(layout.committed_scenes(split))
        missing = count - sum(scene < count for scene in there)
        if missing:
            # The recipe may have any number of scenes: list only the first few.
            first = list(islice((scene for scene in range(count) if scene not in there), 10))
            numbers = ", ".join(map(str, first)) + (", ..." if missing > 10 else "")
            failed = sum(
                where == split and scene < count and scene not in there
                for where, scene in quarantined_scenes(layout.tree)
            )
            quarantined = f", {failed} of them in quarantine" if failed else ""
            message = (
                f"{missing} of the recipe's {count} {split} scenes are not finished ({numbers}){quarantined}"
            )
            yield Problem(layout.recipe.name, message, split)


def _orphans(layout: Layout, known_by_scene: Iterable[set[str]]) -> Iterator[Problem]:
    """Files in the data set's folders that belong to no finished scene."""
    known = set().union(*known_by_scene)
    for folder in (*FOLDERS, "scenes", "manifest"):
        for name in layout.tree.files_below(folder):
            if name not in known:
                yield Problem(name, "belongs to no finished scene")

"""Rendering again the scenes that `verify` found broken, and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path, PurePosixPath

from datagen.dataset.layout import SPLITS, Layout, SceneKey
from datagen.dataset.manifest import SceneManifest, read_manifest
from datagen.dataset.samples import open_layout
from datagen.errors import DatasetError, MachineError
from datagen.executors import Executor
from datagen.recipe.recipe import Recipe, read_recipe
from datagen.rendering.preflight import NO_BLENDER, has_blender
from datagen.rendering.run import RenderSummary, check_store, render_dataset
from datagen.verify.report import Problem


def broken_scenes(problems: Iterable[Problem]) -> list[SceneKey]:
    """(split, number) of every finished scene with a problem of its own, in order.

    A scene that only could not be checked is not among them.
    """
    found = {
        (item.split, item.scene)
        for item in problems
        if item.split is not None and item.scene is not None and not item.unchecked
    }
    return sorted(found, key=lambda scene: (SPLITS.index(scene[0]), scene[1]))


def problems_left(root: Path | str, problems: Iterable[Problem], repaired: list[SceneKey]) -> list[Problem]:
    """The problems that rendering scenes again did not solve.

    Those of the repaired scenes are left to another check. Those of files that belonged to no scene are solved where
    a repaired scene lists the file.
    """
    layout = open_layout(root)
    listed = {
        entry.path
        for scene in repaired
        for entry in read_manifest(layout.local(layout.manifest(*scene))).files
    }
    return [
        problem
        for problem in problems
        if (problem.split, problem.scene) not in repaired and str(PurePosixPath(problem.place)) not in listed
    ]


def check_repairable(root: Path | str, broken: list[SceneKey]) -> None:
    """Raise DatasetError, one sentence, if the broken scenes of a data set cannot be rendered again here.

    The user assets must be there, this Python must have Blender, and the recipe must be the one that the other scenes
    were rendered by: else it is the recipe that is wrong, and every scene would be replaced by another.
    """
    layout = open_layout(root)
    recipe = read_recipe(layout.recipe)
    for split, scene in broken:
        if scene >= recipe.scenes.get(split, 0):
            raise DatasetError(
                f"{layout.recipe}: has no scene {scene} in its split {split}, so it cannot be rendered again"
            )
    _check_recipe(layout, recipe)
    check_store(layout.tree, recipe)
    if not has_blender():
        raise MachineError(NO_BLENDER)


def _check_recipe(layout: Layout, recipe: Recipe) -> None:
    settings = set()
    for split in SPLITS:
        for scene in layout.committed_scenes(split):
            try:
                settings.add(read_manifest(layout.local(layout.manifest(split, scene))).recipe_sha256)
            except DatasetError:
                continue
            if recipe.settings_sha256() in settings:
                return
    if settings:
        raise DatasetError(
            f"{layout.recipe}: is not the recipe that any of the scenes was rendered by; put that one back, since "
            "rendering by this one would replace them all"
        )


def repair_dataset(
    root: Path | str,
    broken: list[SceneKey],
    *,
    executor: Executor | None = None,
    on_scene: Callable[[int, int, SceneManifest | None], None] | None = None,
) -> RenderSummary:
    """Render broken scenes again, each of which takes the old one's place when it is whole.

    Files that have the same bytes again are not touched. A scene that cannot be rendered stays as it is and is among
    the summary's failures. If this is interrupted, the data set is as it was but for the scenes that were done; what
    was just being moved is finished by the next render or repair.

    Args:
        root: The data set's folder, or a URL.
        broken: (split, number) of the scenes.
        executor: Where scenes are rendered; None for worker processes on this machine.
        on_scene: Called after each scene with (scenes done, scenes in all, the manifest or None if it failed).

    Raises:
        DatasetError: As `check_repairable` and `render_dataset` do; nothing has been touched then.
    """
    check_repairable(root, broken)
    recipe = read_recipe(open_layout(root).recipe)
    splits = {split for split, _ in broken}
    asked = replace(recipe, scenes={split: recipe.scenes[split] for split in splits})
    return render_dataset(asked, root, executor=executor, only=broken, again=True, on_scene=on_scene)

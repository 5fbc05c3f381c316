"""Rendering again the scenes that `verify` found broken, and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path, PurePosixPath

from datagen.dataset.layout import SPLITS, Layout, SceneKey
from datagen.dataset.manifest import SceneManifest
from datagen.dataset.samples import open_layout
from datagen.executors import Executor
from datagen.recipe.recipe import read_recipe
from datagen.rendering.run import RenderSummary, render_dataset
from datagen.rendering.staging import discard_uncommitted
from datagen.verify.report import Problem


def broken_scenes(problems: Iterable[Problem]) -> list[SceneKey]:
    """(split, number) of every finished scene with a problem, in order."""
    found = {
        (item.split, item.scene) for item in problems if item.split is not None and item.scene is not None
    }
    return sorted(found, key=lambda scene: (SPLITS.index(scene[0]), scene[1]))


def problems_left(problems: Iterable[Problem], repaired: list[SceneKey]) -> list[Problem]:
    """The problems of no finished scene, without those of files that a repaired scene has replaced or listed."""
    paths = [PurePosixPath(path) for scene in repaired for path in Layout(Path()).scene_paths(*scene)]
    return [
        problem
        for problem in problems
        if problem.scene is None
        and not any(PurePosixPath(problem.place).is_relative_to(path) for path in paths)
    ]


def repair_dataset(
    root: Path | str,
    broken: list[SceneKey],
    *,
    executor: Executor | None = None,
    on_scene: Callable[[int, int, SceneManifest | None], None] | None = None,
) -> RenderSummary:
    """Remove broken scenes and render them again.

    If this is interrupted, the next render of the data set does the rest.

    Args:
        root: The data set's folder, or a URL.
        broken: (split, number) of the scenes.
        executor: Where scenes are rendered; None for worker processes on this machine.
        on_scene: Called after each scene with (scenes done, scenes in all, the manifest or None if it failed).

    Raises:
        DatasetError: As `render_dataset` does.
    """
    layout = open_layout(root)
    recipe = read_recipe(layout.recipe)
    for split, scene in broken:
        layout.tree.remove(Layout(Path()).manifest(split, scene).as_posix())
        discard_uncommitted(layout.tree, split, scene)
    # A scene beyond the recipe's numbers is not rendered again: the recipe does not ask for it.
    splits = {split for split, _ in broken}
    asked = replace(recipe, scenes={split: recipe.scenes.get(split, 0) for split in splits})
    return render_dataset(asked, root, executor=executor, only=broken, on_scene=on_scene)

"""Rendering as a step of a pipeline: with progress, complete or refused."""

from __future__ import annotations

from pathlib import Path

from datagen import Recipe, render_dataset
from stereoforge.errors import CommandError
from stereoforge.progress import progress_bar


def render_all(recipe: Recipe, root: Path) -> None:
    """Render what is missing of a recipe. Raises CommandError if a scene could not be rendered."""
    with progress_bar() as progress:
        task = progress.add_task(f"rendering {recipe.family}", total=None)
        summary = render_dataset(
            recipe, root, on_scene=lambda done, total, _: progress.update(task, completed=done, total=total)
        )
    if summary.failures:
        first = summary.failures[0]
        raise CommandError(
            f"{len(summary.failures)} scenes could not be rendered, {first.name} because: {first.reason}"
        )

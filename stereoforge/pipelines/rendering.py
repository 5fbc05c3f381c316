"""Rendering as a step of a pipeline: with progress, complete or refused."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Literal

from datagen import DatasetError, Recipe, render_dataset
from datagen.dataset.manifest import SceneManifest
from datagen.executors.devices import find_gpus
from datagen.rendering.preflight import check_device
from stereoforge.errors import CommandError
from stereoforge.progress import progress_bar

CyclesDevice = Literal["cpu", "cuda", "optix", "hip", "metal"]


def choose_device() -> CyclesDevice:
    """The fastest device that Blender finds on this machine.

    Blender is asked, which takes seconds, only where the drivers list a GPU.
    """
    gpus: tuple[CyclesDevice, ...] = ("optix", "cuda", "hip")
    candidates = [device for device in gpus if find_gpus(device, os.environ)]
    if sys.platform == "darwin":
        candidates.append("metal")
    for device in candidates:
        try:
            check_device(device)
        except DatasetError:
            continue
        return device
    return "cpu"


def render_all(recipe: Recipe, root: Path) -> None:
    """Render what is missing of a recipe, and name a first picture as soon as there is one.

    Raises CommandError if a scene could not be rendered.
    """
    shown = False
    with progress_bar() as progress:
        task = progress.add_task(f"rendering {recipe.family}", total=None)

        def on_scene(done: int, total: int, scene: SceneManifest | None) -> None:
            nonlocal shown
            progress.update(task, completed=done, total=total)
            if scene is not None and not shown:
                shown = True
                progress.console.print(f"a first picture: {root / _first_picture(scene)}", markup=False)

        summary = render_dataset(recipe, root, on_scene=on_scene)
    if summary.failures:
        first = summary.failures[0]
        raise CommandError(
            f"{len(summary.failures)} scenes could not be rendered, {first.name} because: {first.reason}"
        )


def _first_picture(scene: SceneManifest) -> str:
    """The path of a left picture of a scene, relative to its data set."""
    return min(file.path for file in scene.files if file.path.endswith(".png") and "/left/" in file.path)

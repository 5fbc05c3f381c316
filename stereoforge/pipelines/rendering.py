"""Rendering as a step of a pipeline: with progress, complete or refused."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Literal

from datagen import DatasetError, Recipe, render_dataset
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

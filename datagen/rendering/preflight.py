"""Preflight checks: whether this machine has Blender and the device, and the family the disparities, for a run."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from datagen.errors import DatasetError
from datagen.recipe.curation import share_outside
from datagen.recipe.disparity_range import surface_disparities
from datagen.recipe.recipe import Recipe
from scenes.user_assets.pool import AssetPool
from stereoforge_kit.processes import WorkerError, call_limited

DEVICE_TIMEOUT_S = 300.0
"""On its first use a driver may compile for a while."""

NO_BLENDER = (
    "rendering needs Blender: pip install 'stereoforge[render]' on Python 3.11 (bpy 4.5) or 3.13 (bpy 5.2)"
)

NO_OPENGL = (
    "the engine workbench draws with OpenGL, which does not work here: a driver is missing; in software it is "
    "apt-get install libegl1 libgl1-mesa-dri"
)


def has_blender() -> bool:
    """Whether this Python has bpy, without loading it, which takes seconds."""
    try:
        return find_spec("bpy") is not None
    except ValueError:  # Something has put itself in the module's place.
        return False


def check_device(device: str) -> None:
    """Raise DatasetError unless Cycles finds such a device on this machine.

    Cycles is asked in a process of its own, since drivers crash.
    """
    if device == "cpu":
        return
    try:
        found = call_limited(_finds, (device,), memory_bytes=None, timeout_s=DEVICE_TIMEOUT_S)
    except WorkerError as error:
        raise DatasetError(f"Blender could not be asked for {device} devices: {error}") from error
    if not found:
        raise DatasetError(
            f"Blender finds no {device} device on this machine; render on the cpu, or elsewhere"
        )


def check_engine(engine: str) -> None:
    """Raise DatasetError unless the engine makes a picture on this machine: Workbench needs OpenGL.

    It is tried in a process of its own, since drivers crash.
    """
    if engine == "cycles":
        return
    try:
        drawn = call_limited(_draws, memory_bytes=None, timeout_s=DEVICE_TIMEOUT_S)
    except (WorkerError, RuntimeError):
        drawn = False
    if not drawn:
        raise DatasetError(NO_OPENGL)


def check_disparity_range(recipe: Recipe) -> None:
    """Raise DatasetError if a scene with the recipe's range of disparities is not found in as many attempts as one has.

    Scenes are sampled and ray-cast until one is found, which takes seconds.
    """
    curation = recipe.curation
    if not curation.enabled or not curation.disparity_px:
        return
    plain = replace(recipe, curriculum_scenes=0, assets=AssetPool())
    least, spread = 1.0, (0.0, 0.0)
    for attempt in range(curation.attempts):
        surfaces = surface_disparities(plain.sample("train", 0, attempt))
        share = share_outside(surfaces, curation)
        if share <= curation.max_outside:
            return
        if share <= least:
            least, spread = share, tuple(np.percentile(surfaces, (1, 99)))
    low, high = curation.disparity_px
    raise DatasetError(
        f"worlds of {recipe.family} do not keep within disparities of {low:g} to {high:g} px at {recipe.world.width}x"
        f"{recipe.world.height}: the best of {curation.attempts} has {least:.0%} of its surfaces outside and spans "
        f"{spread[0]:.0f} to {spread[1]:.0f} px; ask for a wider range"
    )


def _finds(device: str) -> bool:
    """Runs in a process of its own, where Blender may be loaded."""
    from datagen.blender.session import finds_device

    return finds_device(device)


def _draws() -> bool:
    """Runs in a process of its own, too."""
    from datagen.blender.draft import draws

    return draws()

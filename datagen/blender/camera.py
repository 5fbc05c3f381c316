"""Rendering one view at one instant, and reading the channels that Cycles writes."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from numpy.typing import NDArray

from datagen.blender.build import BuiltWorld, place


def render_view(world: BuiltWorld, view: str, frame: int, scratch: Path) -> NDArray[np.float32]:
    """(H, W, 3) float32 scene-linear RGB of one view of one frame, denoised.

    scratch: An existing folder for Blender's temporary file.
    """
    place(world, view, float(frame))
    # The two views must not share their noise: the same pattern in both would match at disparity 0.
    return render_radiance(world, f"{view}_{frame}", 2 * frame + (view == "right"), scratch)


def render_radiance(world: BuiltWorld, name: str, seed: int, scratch: Path) -> NDArray[np.float32]:
    """(H, W, 3) float32 scene-linear RGB of the world as it is placed now.

    name: The temporary file's name in `scratch`. seed: That of Cycles' noise.
    """
    channels = render_channels(world, name, seed, scratch)
    return np.stack([channels[f"Combined.{c}"] for c in "RGB"], axis=-1)


def render_channels(world: BuiltWorld, name: str, seed: int, scratch: Path) -> dict[str, NDArray[np.float32]]:
    """All channels that Cycles makes, (H, W) float32 each, by their names without the layer's name."""
    world.blender_scene.cycles.seed = seed
    path = scratch / f"{name}.exr"
    channels: dict[str, NDArray[np.float32]] = {}
    try:
        with _plain_name(scratch) as folder:
            world.blender_scene.render.filepath = f"{folder}/{name}.exr"
            bpy.ops.render.render(write_still=True)
        if not path.is_file():
            raise OSError(errno.EIO, "Blender could not write its picture", str(path))
        with OpenEXR.File(str(path), separate_channels=True) as file:
            # Blender 4.5 writes one part with all channels, 5.x one part a pass.
            for part in file.parts:
                for key, channel in part.channels.items():
                    channels[key.split(".", 1)[1] if key.count(".") > 1 else key] = channel.pixels
    finally:
        path.unlink(missing_ok=True)
    return channels


@contextmanager
def _plain_name(folder: Path) -> Iterator[str]:
    """Another name of a folder, without anything that Blender interprets.

    In a path of its own Blender takes {fps} for a variable, # for the frame's number and // for the blend file's
    folder. The user's path may have any of them.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{descriptor}"
    finally:
        os.close(descriptor)

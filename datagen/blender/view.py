"""Rendering one eye at one instant, and reading what Cycles wrote."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import OpenEXR
from numpy.typing import NDArray

from datagen.blender.build import BuiltWorld, place

BEYOND_EVERYTHING_M = 1e9
"""Cycles writes 1e10 as the depth of pixels that hit nothing."""


@dataclass(frozen=True)
class View:
    """What one eye sees."""

    radiance: NDArray[np.float32]
    """(H, W, 3) scene-linear RGB, denoised."""
    depth_m: NDArray[np.float32]
    """(H, W) distance along the optical axis through each pixel's centre; inf where nothing is hit."""
    object_index: NDArray[np.uint16]
    """(H, W) 0 where nothing is hit, else 1 + the index in `Scene.objects`."""


def render_view(world: BuiltWorld, eye: str, frame: int, scratch: Path) -> View:
    """Render one eye of one frame; `scratch` is an existing folder for Blender's temporary file."""
    place(world, eye, float(frame))
    # The two eyes must not share their noise: the same pattern in both would match at disparity 0.
    channels = _render(world, f"{eye}_{frame}", 2 * frame + (eye == "right"), scratch)
    depth = _channel(channels, "Depth.Z", "Depth.V")
    return View(
        radiance=_radiance(channels),
        depth_m=np.where(depth >= BEYOND_EVERYTHING_M, np.float32(np.inf), depth),
        object_index=np.rint(_channel(channels, "IndexOB.X", "Object Index.X", "IndexOB.V")).astype(
            np.uint16
        ),
    )


def render_radiance(world: BuiltWorld, name: str, seed: int, scratch: Path) -> NDArray[np.float32]:
    """(H, W, 3) scene-linear RGB of the world as it stands."""
    return _radiance(_render(world, name, seed, scratch))


def _render(world: BuiltWorld, name: str, seed: int, scratch: Path) -> dict[str, NDArray[np.float32]]:
    """All channels Cycles makes, by their names without the layer's."""
    world.blender_scene.cycles.seed = seed
    path = scratch / f"{name}.exr"
    world.blender_scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    channels: dict[str, NDArray[np.float32]] = {}
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            # Blender 4.5 writes one part with all channels, 5.x one part a pass.
            for part in file.parts:
                for key, channel in part.channels.items():
                    channels[key.split(".", 1)[1] if key.count(".") > 1 else key] = channel.pixels
    finally:
        path.unlink(missing_ok=True)
    return channels


def _radiance(channels: dict[str, NDArray[np.float32]]) -> NDArray[np.float32]:
    return np.stack([_channel(channels, f"Combined.{c}") for c in "RGB"], axis=-1)


def _channel(channels: dict[str, NDArray[np.float32]], *names: str) -> NDArray[np.float32]:
    for name in names:
        if name in channels:
            return channels[name]
    raise RuntimeError(f"Blender's file has no channel {names[0]!r}, only {', '.join(sorted(channels))}")

"""Drafts: pictures by Blender's Workbench, which draws textures and shading with OpenGL.

Lamps, shadows, reflections, glass and the world's light are left out: surfaces have their own colours under a fixed
set of lights that comes with the camera. The ground truth is that of the same scene.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from datagen.blender.build import BuiltWorld, place
from datagen.blender.camera import render_channels
from datagen.blender.exact import set_exactly
from datagen.dataset.layout import View
from datagen.ground_truth.raycast import Hits, SceneRayCaster
from scenes import Scene
from scenes.spec import World
from scenes.user_assets.pool import UserEnvironment
from stereoforge_kit.srgb import to_linear

SAMPLES = "5"
"""Of Workbench's settings for smooth edges."""
CLEARANCE = 2.0
"""The near plane lies so many times nearer than the nearest pixel, since edges are sampled between pixels too; the far
plane as many times farther than the farthest."""


def use_workbench(blender_scene: bpy.types.Scene, threads: int) -> None:
    """Let a scene be drawn by Workbench, on a ground that is transparent where nothing is hit.

    threads: CPU threads that Mesa may use; it reads them once in a process.
    """
    os.environ["LP_NUM_THREADS"] = str(threads)
    blender_scene.render.engine = "BLENDER_WORKBENCH"
    blender_scene.render.film_transparent = True
    display = blender_scene.display
    display.render_aa = SAMPLES
    display.shading.light = "STUDIO"
    display.shading.color_type = "TEXTURE"
    display.shading.show_specular_highlight = True
    display.shading.show_cavity = True
    display.shading.cavity_type = "BOTH"
    # Each shadow is a volume that is drawn once a sample: a street takes six times as long with them.
    display.shading.show_shadows = False


def draws() -> bool:
    """Whether Workbench draws a picture here: it needs OpenGL, in software at least."""
    from datagen.blender.session import CyclesSettings, start_empty_file

    scene = start_empty_file(CyclesSettings(samples=1))
    use_workbench(scene, 1)
    block = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(block)
    scene.camera = block
    scene.render.resolution_x = scene.render.resolution_y = 16
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.exr"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
        return path.is_file()


def render_draft(
    world: BuiltWorld, view: View, frame: int, hits: Hits, caster: SceneRayCaster, scratch: Path
) -> NDArray[np.float32]:
    """(H, W, 3) float32 scene-linear RGB of one view of one frame.

    Args:
        world: The world, which `use_workbench` was told of.
        view: "left" or "right".
        frame: The frame's number from 0.
        hits: The view's truth, (H, W) each.
        caster: Of the same scene.
        scratch: An existing folder for Blender's temporary file.
    """
    place(world, view, float(frame))
    near, far = _depth_range(world.scene, hits)
    # A depth buffer tells depths apart in proportion to their range: between 1 mm and 10,000 km, hardly.
    set_exactly(world.camera.data, "clip_start", near)
    set_exactly(world.camera.data, "clip_end", far)
    channels = render_channels(world, f"{view}_{frame}", 0, scratch)
    drawn = np.stack([channels[f"Combined.{c}"] for c in "RGB"], axis=-1)
    clear = 1.0 - channels["Combined.A"]
    rows, columns = np.nonzero(clear > 0)
    directions = (
        caster.directions(view, rows, columns) @ world.scene.camera.pose(view, float(frame))[:3, :3].T
    )
    drawn[rows, columns] += clear[rows, columns, None] * sky_radiance(world.scene.world, directions)
    return drawn


def _depth_range(scene: Scene, hits: Hits) -> tuple[float, float]:
    """The near and the far plane in metres."""
    depths = scene.camera.depth(hits.disparity[hits.object_index > 0])
    if not len(depths):
        return 1.0, 2.0
    return float(depths.min()) / CLEARANCE, float(depths.max()) * CLEARANCE


def sky_radiance(world: World, directions: NDArray[np.float64]) -> NDArray[np.float32]:
    """(N, 3) linear RGB of the environment in directions (N, 3), as Blender lays an equirectangular picture around.

    Its strength is left out: it is for the light that falls on surfaces, and Workbench's light is always the same.
    """
    environment = world.environment
    if isinstance(environment, UserEnvironment):
        light = environment.radiance()
    else:
        light = to_linear(environment.image() / 255.0).astype(np.float32)
    height, width, _ = light.shape
    x, y, z = directions.T
    column = (0.5 - np.arctan2(y, x) / (2 * np.pi)) * width - 0.5
    row = (0.5 - np.arctan2(z, np.hypot(x, y)) / np.pi) * height - 0.5
    # Round at the sides, and at the poles what is nearest.
    wide = np.concatenate([light[:, -1:], light, light[:, :1]], axis=1)
    places = np.stack([row, column + 1])
    channels = [map_coordinates(wide[..., c], places, order=1, mode="nearest") for c in range(3)]
    return np.stack(channels, axis=-1).astype(np.float32)

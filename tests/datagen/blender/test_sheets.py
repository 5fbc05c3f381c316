"""Thin sheets: light passes straight through them, from the backdrop and from lamps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from datagen.blender.build import build_world
from datagen.blender.camera import render_view
from datagen.blender.session import CyclesSettings, quiet, start_empty_file
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from scenes import Scene
from scenes.shapes.solids.basic import Plane
from scenes.spec import Material, SceneObject, StereoCamera, SunLight, Trajectory, World
from scenes.textures.plain import SolidColor

WHITE = SolidColor((255, 255, 255))
PANE = Material(WHITE, roughness=0.0, specular=0.5, transmission=0.9, thin=True)


def world(pane: Material | None) -> Scene:
    """A white wall lit by a sun from behind the camera, and a pane between them."""
    wall = SceneObject("wall", Plane(), 0, Trajectory.static((0.0, 0.0, -10.0)), (50.0, 50.0, 1.0))
    sheet = SceneObject("pane", Plane(), 1, Trajectory.static((0.0, 0.0, -5.0)), (50.0, 50.0, 1.0))
    return Scene(
        family="sheets",
        frames=1,
        camera=StereoCamera(24, 16, 32.0, 0.2, Trajectory.static()),
        objects=(wall, sheet) if pane else (wall,),
        materials=(Material(WHITE), pane or PANE),
        lights=(SunLight((0.0, 0.0, -1.0), (1.0, 1.0, 1.0), 2.0, 0.5),),
        world=World(SolidColor((0, 0, 0))),
    )


def brightness(scene: Scene, folder: Path) -> float:
    with quiet(folder / "log"):
        built = build_world(build_geometry(scene), start_empty_file(CyclesSettings(samples=32)))
        return float(render_view(built, "left", 0, folder).mean())


def test_light_passes_a_sheet_twice_and_ground_truth_is_of_the_sheet(tmp_path: Path) -> None:
    bare, behind = brightness(world(None), tmp_path), brightness(world(PANE), tmp_path)
    # About 0.9 on either way, less what is reflected; what is not transmitted adds its own diffuse light.
    assert 0.65 * bare < behind < 1.02 * bare
    thick = brightness(world(replace(PANE, thin=False)), tmp_path)
    assert thick < 0.5 * bare  # Refracted sunlight would need caustics, which are off.
    hits = SceneRayCaster(build_geometry(world(PANE))).cast_all("left", 0.0)
    np.testing.assert_allclose(hits.disparity, 24 * 0.2 / 5.0)

"""Lamps that are carried along, beams, and panes that light passes, against closed forms; Blender renders."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from datagen.blender.build import build_world
from datagen.blender.camera import render_view
from datagen.blender.session import CyclesSettings, quiet, start_empty_file
from datagen.ground_truth.scene_geometry import build_geometry
from scenes import Scene
from scenes.shapes.solids.basic import Box, Plane
from scenes.spec import AreaLight, Material, SceneObject, StereoCamera, Trajectory, World
from scenes.textures.plain import SolidColor

WIDTH, HEIGHT = 96, 64
WALL_M = 4.0
WALL = SceneObject("wall", Plane(), 0, Trajectory.static((0.0, 0.0, -WALL_M)), (20.0, 20.0, 1.0))
WHITE = Material(SolidColor((255, 255, 255)))
BLACK = World(SolidColor((0, 0, 0)))
LAMP = AreaLight((0.0, 0.0, 0.0), (0.0, 0.0, -WALL_M), (1.0, 1.0, 1.0), 100.0, 0.1)


def world_of(
    *things: SceneObject, lights: tuple[AreaLight, ...] = (), materials: tuple[Material, ...] = ()
) -> Scene:
    camera = StereoCamera(WIDTH, HEIGHT, 16.0, 0.1, Trajectory.static())
    return Scene("lamps", 3, camera, (WALL, *things), (WHITE, *materials), lights, BLACK)


def luminance(scene: Scene, folder: Path, frame: int = 0) -> NDArray[np.float64]:
    """(H, W) of the left view."""
    with quiet(folder / "log"):
        world = build_world(build_geometry(scene), start_empty_file(CyclesSettings(samples=64)))
        return render_view(world, "left", frame, folder).mean(axis=2).astype(np.float64)


def brightest_x_m(picture: NDArray[np.float64]) -> float:
    """x on the wall of the middle of the brightest spot."""
    profile = picture[HEIGHT // 2 - 4 : HEIGHT // 2 + 4].mean(axis=0)
    bright = profile > 0.9 * profile.max()
    x = (np.arange(WIDTH) + 0.5 - WIDTH / 2)[bright].mean()
    return float(x / (16.0 / 32.0 * WIDTH) * WALL_M)


def test_a_carried_lamp_shines_from_where_it_is_at_each_frame(tmp_path: Path) -> None:
    path = Trajectory((0.0, 2.0), ((-1.5, 0.0, 0.0), (1.5, 0.0, 0.0)), ((1.0, 0.0, 0.0, 0.0),) * 2)
    near = replace(LAMP, position_m=(0.0, 0.0, -WALL_M + 1.0), motion=path)
    scene = world_of(lights=(near,))
    for frame, x_m in ((0, -1.5), (1, 0.0), (2, 1.5)):
        assert brightest_x_m(luminance(scene, tmp_path, frame)) == pytest.approx(x_m, abs=0.25)


def test_a_bare_lamp_lights_a_wall_by_lambert_s_law_and_a_beam_lights_less_of_it(tmp_path: Path) -> None:
    bare = luminance(world_of(lights=(LAMP,)), tmp_path)
    # E = P / (pi d^2) straight ahead of a small lamp, radiance of white paint E / pi.
    assert bare[HEIGHT // 2, WIDTH // 2] == pytest.approx(100.0 / (np.pi * WALL_M**2) / np.pi, rel=0.05)
    beam = luminance(world_of(lights=(replace(LAMP, spread_deg=40.0),)), tmp_path)
    assert beam[HEIGHT // 2, WIDTH // 2] > 1.5 * bare[HEIGHT // 2, WIDTH // 2]
    edge = WIDTH // 2 + round(np.tan(np.radians(30.0)) * 16.0 / 32.0 * WIDTH)
    assert beam[HEIGHT // 2, edge] < 0.02 * beam.max()
    assert bare[HEIGHT // 2, edge] > 0.3 * bare.max()


@pytest.mark.parametrize("turn_deg", [0.0, 44.0])  # At 44 degrees a face from within reflects all light.
def test_a_pane_lets_light_through_at_any_angle(tmp_path: Path, turn_deg: float) -> None:
    """A closed sheet reflects Fresnel's share once, at its front; its inside is no mirror."""
    half = np.radians(turn_deg) / 2
    turn = (float(np.cos(half)), 0.0, float(np.sin(half)), 0.0)
    pane = SceneObject(
        "pane", Box((1.0, 1.0, 0.01)), 1, Trajectory.static((0.0, 0.0, -2.0), turn), (1.0, 1.0, 1.0)
    )
    glow = Material(SolidColor((255, 255, 255)), emission=1.0)
    glass = Material(SolidColor((0, 0, 0)), roughness=0.0, specular=0.5, transmission=1.0, thin=True)
    scene = replace(world_of(pane, materials=(glass,)), materials=(glow, glass))
    picture = luminance(scene, tmp_path)
    eta, cosine = 1.45, np.cos(np.radians(turn_deg))
    inner = np.sqrt(1 - (1 - cosine**2) / eta**2)
    across = ((cosine - eta * inner) / (cosine + eta * inner)) ** 2
    along = ((eta * cosine - inner) / (eta * cosine + inner)) ** 2
    expected = 1 - (across + along) / 2
    seen = picture[HEIGHT // 2 - 3 : HEIGHT // 2 + 3, WIDTH // 2 - 3 : WIDTH // 2 + 3].mean()
    clear = picture[:6, :6].mean()
    assert seen / clear == pytest.approx(expected, abs=0.04)

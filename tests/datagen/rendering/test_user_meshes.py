"""What Blender shows of a user's textured mesh is what its file says, and ground truth is of the same surface."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import minimum_filter
from scipy.spatial.transform import Rotation

from datagen.recipe.preparation.meshes import prepare_mesh
from datagen.rendering.frames import RenderOptions, render_frames
from scenes.motion.trajectories import quaternion
from scenes.spec import Material, Scene, SceneObject, StereoCamera, Trajectory, World
from scenes.textures.plain import SolidColor
from scenes.user_assets.pool import UserMesh
from tests.datagen.recipe.test_mesh_materials import QUARTERS, png, stored, write_obj

ANGLES_DEG = ((25.0, 35.0, 10.0), (-160.0, 20.0, 80.0), (100.0, -50.0, 5.0))
PLACE = np.array((0.1, -0.05, -5.0))
YELLOW = (255, 230, 0)
COLORS = np.array([*QUARTERS[[0, 0, -1, -1], [0, -1, 0, -1]], YELLOW], float)
"""Of the picture's quarters, upper left, upper right, lower left, lower right, and of the plain side."""
MTL = "newmtl a\nmap_Kd quarters.png\nnewmtl b\nKd 1 0.791 0\n"


def cube(tmp_path: Path) -> UserMesh:
    path = write_obj(tmp_path / "mine", MTL)
    (tmp_path / "mine/quarters.png").write_bytes(png(QUARTERS))
    return stored(prepare_mesh(path), tmp_path)


def world(shape: UserMesh, turn: Rotation) -> Scene:
    """A matte convex thing in even white light: every point shows its own colour."""
    materials = shape.materials()
    thing = SceneObject(
        "cube",
        shape,
        0,
        Trajectory.static(tuple(PLACE), quaternion(turn)),
        more_materials=tuple(range(1, len(materials))),
    )
    camera = StereoCamera(144, 96, 40.0, 0.2, Trajectory.static())
    return Scene("flying_things", 1, camera, (thing,), materials, (), World(SolidColor((255, 255, 255))))


def seen(scene: Scene, turn: Rotation) -> tuple[np.ndarray, np.ndarray]:
    """Disparity (H, W), 0 for the sky, and the number of the colour, -1 for the sky: slabs, in double precision."""
    camera = scene.camera
    fx = camera.focal_mm / 32 * camera.width
    rows, columns = np.indices((camera.height, camera.width)) + 0.5
    rays = np.stack(
        [(columns - camera.width / 2) / fx, -(rows - camera.height / 2) / fx, -np.ones_like(rows)], -1
    )
    origin, rays = turn.inv().apply(-PLACE), turn.inv().apply(rays.reshape(-1, 3))
    near, far = np.sort([(-1 - origin) / rays, (1 - origin) / rays], axis=0)
    axis, distance = near.argmax(axis=1), near.max(axis=1)
    hit = distance < far.min(axis=1)
    points = origin + distance[:, None] * rays
    flat = np.array([np.delete(point, k) for point, k in zip(points, axis, strict=True)])
    number = (flat[:, 0] > 0) + 2 * (flat[:, 1] < 0)
    number[(axis == 2) & (points[:, 2] < 0)] = 4
    shape = (camera.height, camera.width)
    disparity = np.where(hit, fx * camera.baseline_m / np.where(hit, distance, 1), 0)
    return disparity.reshape(shape), np.where(hit, number, -1).reshape(shape)


@pytest.mark.slow
def test_textures_are_where_the_file_says(tmp_path: Path) -> None:
    shape = cube(tmp_path)
    looked_at = set()
    for angles in ANGLES_DEG:
        turn = Rotation.from_euler("XYZ", angles, degrees=True)
        scene = world(shape, turn)
        options = RenderOptions(samples=4, targets=("material_index", "reflective"))
        _, targets = next(render_frames(scene, tmp_path, options))
        left = targets["left"]
        disparity, number = seen(scene, turn)
        error = np.abs(left.disparity - disparity)[(left.object_index > 0) == (number >= 0)]
        print(f"disparity p99.9 {np.percentile(error, 99.9):.1e} px")
        assert np.percentile(error, 99.9) <= 1e-3
        inner = (number >= 0) & (minimum_filter(number, 5) == -minimum_filter(-number, 5))
        looked_at |= {*number[inner].tolist()}
        # Directions of colours, since exposure and the tone curve change their brightness.
        pixels = left.images["clean"][inner].astype(float)
        units, colors = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (pixels, COLORS))
        shown = np.linalg.norm(units[:, None] - colors, axis=2).argmin(axis=1)
        # At a side's edge the picture, which repeats, runs into its other edge.
        assert (shown == number[inner]).mean() > 0.97
        plain = next(
            k for k, material in enumerate(scene.materials) if isinstance(material.color, SolidColor)
        )
        expected = np.where(number < 0, 0, np.where(number == 4, 1 + plain, 2 - plain))
        made = left.extra["material_index", None]
        assert (made == expected).mean() > 0.998
        assert not left.extra["reflective", None].any()
    assert looked_at == {0, 1, 2, 3, 4}


@pytest.mark.slow
def test_a_picture_of_finishes_changes_what_is_rendered(tmp_path: Path) -> None:
    """One half of the surface is a mirror and the other chalk, under a sky of two colours."""
    finish = np.zeros((16, 16, 3), np.uint8)
    finish[:, :8], finish[:, 8:] = (0, 0, 255), (0, 255, 0)
    path = write_obj(tmp_path / "mine", "newmtl a\nmap_Kd white.png\nnewmtl b\nmap_Kd finish.png\n")
    (tmp_path / "mine/white.png").write_bytes(png(np.full((16, 16, 3), 255, np.uint8)))
    (tmp_path / "mine/finish.png").write_bytes(png(finish))
    shape = stored(prepare_mesh(path), tmp_path)
    materials = shape.materials()
    white, finishes = sorted(materials, key=lambda one: one.color.image()[0, 0].tolist(), reverse=True)
    mapped, black = replace(white, finish=finishes.color), Material(SolidColor((0, 0, 0)))
    turn = Rotation.identity()
    scene = world(shape, turn)
    (thing,) = scene.objects
    behind = replace(
        thing, name="black", motion=Trajectory.static((0.0, 0.0, 4.0)), material=2, more_materials=(2,)
    )
    scene = replace(scene, materials=(mapped, mapped, black), objects=(thing, behind))
    _, targets = next(render_frames(scene, tmp_path, RenderOptions(samples=8)))
    image = targets["left"].images["clean"].astype(float).mean(axis=2)
    _, number = seen(scene, turn)
    mirror, chalk = (image[np.isin(number, half)] for half in ((0, 2), (1, 3)))
    assert mirror.min() < 0.7 * np.median(chalk), "the mirror shows the black thing behind the camera"
    assert chalk.min() > 0.8 * np.median(chalk)

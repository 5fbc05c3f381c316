"""Instances and deforming meshes: what Blender renders, frame after frame, is the record's geometry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from datagen.dataset.layout import VIEWS, View
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.rendering.frames import RenderOptions, ViewTargets, render_frames
from scenes import Scene
from scenes.motion.deformations.sway import Sway
from scenes.motion.trajectories import quaternion
from scenes.shapes.solids.basic import Superquadric
from scenes.spec import SceneObject, Trajectory
from tests.datagen.oracle import cast_depth, to_camera_frame
from tests.datagen.worlds import Plate, plates

WIDTH, HEIGHT, FRAMES = 96, 64, 3
SWAY = Sway(amplitude=0.9, direction_deg=20.0, period_frames=8.0)
BALL = Superquadric.sample(np.random.default_rng(3))


def make_scene() -> Scene:
    """Twelve turned, stretched instances of one solid, two swaying ones, one of them flying, and a wall."""
    scene = plates(WIDTH, HEIGHT, Plate((0.0, 0.0), 20.0, (60.0, 60.0)), Plate((0.0, 0.0), 21.0, (1.0, 1.0)))
    rng = np.random.default_rng(0)
    instances = [
        SceneObject(
            f"instance {k}",
            BALL,
            material=k % 2,
            motion=Trajectory.static(
                (1.6 * (k % 6 - 2.5), 2.6 * (k // 6 - 0.5), -9.0 - 0.3 * k),
                quaternion(Rotation.random(random_state=rng)),
            ),
            scale_m=(0.6, 0.9, 0.7),
        )
        for k in range(12)
    ]
    path = Trajectory((0.0, 2.0), ((1.2, 0.0, -6.0), (1.8, 0.3, -5.0)), ((1.0, 0.0, 0.0, 0.0),) * 2)
    swaying = [
        SceneObject("rooted", BALL, 0, Trajectory.static((-1.5, 0.0, -6.0)), deformation=SWAY),
        SceneObject("flying", BALL, 1, path, deformation=replace(SWAY, phase=0.3)),
    ]
    return replace(scene, frames=FRAMES, objects=(*scene.objects, *instances, *swaying))


Frames = list[tuple[dict[View, ViewTargets], NDArray[np.float64]]]


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Frames, int]:
    """The scene, and for each frame its arrays and the triangles Blender saw; the number of its meshes."""
    from tests.datagen.blender_geometry import evaluated_triangles

    scene = make_scene()
    frames = render_frames(scene, tmp_path_factory.mktemp("blender"), RenderOptions(samples=1))
    made = [(targets, evaluated_triangles()) for _, targets in frames]
    import bpy

    return scene, made, len(bpy.data.meshes)


@pytest.mark.parametrize("frame", range(FRAMES))
@pytest.mark.parametrize("view", VIEWS)
def test_every_frame_shows_the_shapes_of_its_instant(
    rendered: tuple[Scene, Frames, int], frame: int, view: View
) -> None:
    scene, frames, _ = rendered
    targets, blenders_triangles = frames[frame]
    own = build_geometry(scene)
    camera = scene.camera
    intrinsics = (camera.focal_px, camera.focal_px, camera.width / 2, camera.height / 2)
    for corners in (own.vertices(frame)[own.triangles], blenders_triangles):
        triangles = to_camera_frame(corners, camera.pose(view, frame))
        depth = cast_depth(triangles, camera.width, camera.height, *intrinsics)
        error = np.abs(targets[view].disparity - camera.disparity_metres / depth)
        assert np.percentile(error, 99.5) < 1e-3
    # The other frames' shapes do not fit.
    stale = to_camera_frame(own.vertices((frame + 1) % FRAMES)[own.triangles], camera.pose(view, frame))
    depth = cast_depth(stale, camera.width, camera.height, *intrinsics)
    error = np.abs(targets[view].disparity - camera.disparity_metres / depth)
    assert np.percentile(error, 95) > 0.01


def test_labels_and_occlusion_follow_the_deformed_shapes(rendered: tuple[Scene, Frames, int]) -> None:
    scene, frames, _ = rendered
    caster = SceneRayCaster(build_geometry(scene))
    rows, columns = (grid.ravel() for grid in np.mgrid[:HEIGHT, :WIDTH])
    for frame, (targets, _) in enumerate(frames):
        for view in VIEWS:
            hits = caster.cast(view, frame, rows, columns)
            assert (targets[view].object_index.ravel() == hits.object_index).mean() > 0.995
            assert (targets[view].occlusion.ravel() == hits.occlusion).mean() > 0.99


def test_rigid_objects_of_one_shape_and_material_share_a_mesh(rendered: tuple[Scene, Frames, int]) -> None:
    # Two plates of different materials, the solid in two materials, and one for each that sways.
    assert rendered[2] == 6


def test_a_frame_looks_the_same_whatever_was_rendered_before(
    rendered: tuple[Scene, Frames, int], tmp_path: Path
) -> None:
    """Shading normals and Cycles' kept geometry follow the deformation, not only the depth."""
    from datagen.blender.build import build_world
    from datagen.blender.camera import render_view
    from datagen.blender.session import CyclesSettings, quiet, start_empty_file

    assert BALL.mesh().smooth
    radiance = []
    for frames in ((2,), (0, 2)):
        with quiet(tmp_path / "log"):
            world = build_world(build_geometry(rendered[0]), start_empty_file(CyclesSettings(samples=1)))
            views = [render_view(world, "left", frame, tmp_path) for frame in frames]
        radiance.append(views[-1])
    assert np.array_equal(*radiance)

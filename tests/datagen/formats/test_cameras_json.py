"""cameras.json: OpenCV projects the world with it to the pixels that show it."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from datagen.cameras.registry import read_calibration
from datagen.errors import FormatError
from datagen.formats import cameras_record, read_cameras, write_cameras
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from scenes import FAMILIES, sample_scene
from scenes.motion.trajectories import quaternion
from scenes.spec import Rig, Trajectory

RIG = Rig(96, 64, 90.0, 97.0, 50.0, 57.5, 30.0, 0.4)


def test_opencv_projects_surface_points_to_their_pixels() -> None:
    """Points found by rays through pixel centres, in the world: cv2.projectPoints brings both views back to them."""
    config = FAMILIES["flying_things"].config(width=96, height=64, frames=2, rig=RIG)
    scene = sample_scene(np.random.default_rng(0), "flying_things", config)
    caster = SceneRayCaster(build_geometry(scene))
    record = cameras_record(scene.camera, {6: 0.0, 7: 1.0})
    for time in (0, 1):
        rows, columns = (grid.ravel() for grid in np.mgrid[:64:9, :96:11])
        points = caster.surface_points("left", time, rows, columns)
        hit = points.triangle >= 0
        corners = caster.geometry.vertices(time)[caster.geometry.triangles[points.triangle[hit]]]
        world = np.einsum("ij,ijk->ik", points.weights[hit], corners)
        seen = {}
        for view, camera in record["frames"][str(6 + time)].items():
            to_camera = np.array(camera["world_to_camera"])
            turn, _ = cv2.Rodrigues(to_camera[:3, :3])
            pixels, _ = cv2.projectPoints(world, turn, to_camera[:3, 3], np.array(camera["K"]), None)
            seen[view] = pixels[:, 0]
            np.testing.assert_allclose(np.linalg.inv(to_camera), camera["camera_to_world"], atol=1e-9)
        np.testing.assert_allclose(seen["left"], np.stack([columns, rows], -1)[hit], atol=1e-4)
        disparity = caster.cast("left", time, rows, columns).disparity[hit]
        np.testing.assert_allclose(seen["left"][:, 0] - seen["right"][:, 0], disparity, atol=1e-4)
        np.testing.assert_allclose(seen["left"][:, 1], seen["right"][:, 1], atol=1e-6)


def test_a_sets_cameras_are_a_calibration(tmp_path: Path) -> None:
    turned = Trajectory.static((1.0, 2.0, 3.0), quaternion(Rotation.from_euler("xyz", (0.3, 0.2, -0.5))))
    write_cameras(tmp_path / "cameras.json", cameras_record(RIG.camera(turned), {6: 0.0}))
    found = read_calibration(tmp_path / "cameras.json").rig()
    np.testing.assert_allclose(list(vars(found).values()), list(vars(RIG).values()), rtol=1e-12)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"frames": 3}', "{" * 5000])
def test_what_is_no_record_of_cameras(text: str, tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(text)
    with pytest.raises(FormatError, match=r"cameras\.json"):
        read_cameras(path)


def test_written_and_read(tmp_path: Path) -> None:
    record = cameras_record(RIG.camera(Trajectory.static()), {6: 0.0})
    write_cameras(tmp_path / "a.json", record)
    assert read_cameras(tmp_path / "a.json") == record == json.loads((tmp_path / "a.json").read_text())

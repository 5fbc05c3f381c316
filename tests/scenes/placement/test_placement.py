"""Placing things: by their anchors, in view, out of the cameras' way, with shared materials."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.placement.assembly import Assembly, anchored_group, anchored_object
from scenes.placement.boxes import OrientedBox
from scenes.placement.clearance import keep_clear
from scenes.placement.view import View, camera_positions
from scenes.shapes.anchored import AnchoredShape
from scenes.shapes.nature.plants import Mushroom
from scenes.shapes.solids.basic import Box
from scenes.shapes.street.furniture import Bollard, LitterBin
from scenes.spec import Material, SceneObject, StereoCamera, Trajectory
from scenes.textures.plain import SolidColor

# At the origin, looking along +y, z up.
FORWARD = Trajectory.static((0.0, 0.0, 0.0), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))
CAMERA = StereoCamera(640, 480, 35.0, 0.5, FORWARD)


def world_vertices(item: SceneObject, time_frames: float = 0.0) -> NDArray[np.float64]:
    pose = item.pose(time_frames)
    vertices: NDArray[np.float64] = item.shape.mesh().vertices @ pose[:3, :3].T + pose[:3, 3]
    return vertices


@pytest.mark.parametrize("shape", [Bollard(0.9, 0.1, 1.2), Mushroom.sample(np.random.default_rng(2))])
@pytest.mark.parametrize("unit_m", [1.0, 0.37])
def test_an_anchored_shape_is_built_about_the_place_of_its_anchor(
    shape: AnchoredShape, unit_m: float
) -> None:
    places = [(2.0, -3.0, 0.5), (4.0, 1.0, 0.0)]
    turns = [Rotation.from_euler("Z", angle) for angle in (0.7, 2.0)]
    item = anchored_object("thing", shape, 0, places, turns, (0.0, 4.0), unit_m=unit_m)
    built = shape.surface().vertices * unit_m
    for time, place, turn in zip((0.0, 4.0), places, turns, strict=True):
        expected = turn.apply(built) + place
        # Welding and splitting reorder the vertices; the bounding box and the middle tell where they are.
        actual = world_vertices(item, time)
        np.testing.assert_allclose(actual.min(axis=0), expected.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(actual.max(axis=0), expected.max(axis=0), atol=1e-6)


def test_a_metric_shape_keeps_its_measures() -> None:
    shape = LitterBin(round=True, height=1.0, width=0.5)
    item = anchored_object("bin", shape, 0, [(0.0, 0.0, 0.0)], [Rotation.identity()])
    assert world_vertices(item)[:, 2].max() == pytest.approx(1.0)
    assert world_vertices(item)[:, 2].min() == pytest.approx(0.0, abs=1e-12)


def test_a_shape_without_an_anchor_stands_on_its_lowest_point() -> None:
    item = anchored_object("box", Box((1.0, 0.5, 0.5)), 0, [(1.0, 2.0, 3.0)], [Rotation.identity()])
    vertices = world_vertices(item)
    assert vertices[:, 2].min() == pytest.approx(3.0)
    np.testing.assert_allclose(vertices[:, :2].mean(axis=0), (1.0, 2.0))


def test_keys_of_unequal_number_are_refused() -> None:
    with pytest.raises(ValueError, match="zip"):
        anchored_object("box", Box((1.0, 1.0, 1.0)), 0, [(0.0, 0.0, 0.0)], [], (0.0,))


def test_equal_materials_are_stored_once_and_things_stay_together() -> None:
    scene = Assembly()
    red, blue = Material(SolidColor((200, 0, 0))), Material(SolidColor((0, 0, 200)))
    assert [scene.material(item) for item in (red, blue, Material(SolidColor((200, 0, 0))))] == [0, 1, 0]
    parts = [("post", Bollard(0.9, 0.1, 1.2), 0), ("", Bollard(0.9, 0.1, 0.0), 1)]
    scene.add(*anchored_group("sign 1", parts, (1.0, 2.0, 0.0), Rotation.identity()))
    assert len(scene.materials) == 2
    assert [item.name for item in scene.objects] == ["sign 1 post", "sign 1"]
    assert len(scene.groups) == 1


def test_a_box_tells_its_distance_to_points() -> None:
    turn = Rotation.from_euler("Z", 90.0, degrees=True).as_matrix()
    box = OrientedBox(np.array((1.0, 0.0, 0.0)), np.array((2.0, 1.0, 1.0)), turn)
    assert box.distance(np.array([(1.0, 1.9, 0.0)])) == 0.0
    assert box.distance(np.array([(1.0, 5.0, 0.0), (9.0, 0.0, 0.0)])) == pytest.approx(3.0)
    assert box.distance(np.array([(3.0, 3.0, 2.0)])) == pytest.approx(np.sqrt(3.0))
    np.testing.assert_allclose(np.abs(box.corners - box.centre), np.tile((1.0, 2.0, 1.0), (8, 1)), atol=1e-12)
    assert np.ptp(box.surface_points, axis=0) == pytest.approx((2.0, 4.0, 2.0))


def test_image_positions_are_where_the_cameras_see_them() -> None:
    view = View(CAMERA, 3)
    x, y, z = np.linalg.inv(view.pose)[:3] @ (*view.point(1.0, -1.0, 8.0), 1.0)
    assert z == pytest.approx(-8.0)
    # The frame's edge, from the middle between the cameras.
    assert (x - 0.25) / 8.0 * CAMERA.focal_px == pytest.approx(320.0)
    assert y / 8.0 * CAMERA.focal_px == pytest.approx(-240.0)


def test_both_cameras_are_looked_at_over_the_whole_scene() -> None:
    positions = camera_positions(CAMERA, 2)
    assert positions.shape == (2 * 5, 3)
    np.testing.assert_allclose(positions[0::2], 0.0, atol=1e-12)
    np.testing.assert_allclose(positions[1::2], np.tile((0.5, 0.0, 0.0), (5, 1)), atol=1e-12)


@pytest.mark.parametrize(
    ("position", "kept"),
    [
        ((0.0, 20.0, 0.0), True),
        ((0.0, 0.9, 0.0), False),  # nearer than the clearance
        ((0.0, 4.0, 0.0), False),  # in view, nearer than allowed
        ((-4.0, 3.0, 0.0), True),  # beside the view
        ((0.0, -40.0, 0.0), False),  # never seen
    ],
)
def test_what_comes_too_near_or_is_never_seen_is_left_out(
    position: tuple[float, float, float], kept: bool
) -> None:
    item = anchored_object("bin", LitterBin(True, 1.0, 0.5), 0, [position], [Rotation.identity()])
    left = keep_clear([(item,)], CAMERA, 1, clearance_m=1.0, nearest_m=6.0)
    assert bool(left) == kept


def test_a_thing_that_passes_the_cameras_is_left_out_with_all_its_parts() -> None:
    still = anchored_object("still", LitterBin(True, 1.0, 0.5), 0, [(0.0, 30.0, 0.0)], [Rotation.identity()])
    turns = [Rotation.identity()] * 2
    passing = anchored_object(
        "passing", LitterBin(True, 1.0, 0.5), 0, [(9.0, 9.0, 0.0), (0.0, 0.5, 0.0)], turns, (-1.0, 6.0)
    )
    groups = [(still,), (still, passing)]
    assert keep_clear(groups, CAMERA, 6, clearance_m=1.0, nearest_m=6.0) == groups[:1]

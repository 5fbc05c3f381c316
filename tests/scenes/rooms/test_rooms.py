"""Rooms: walls that close around their openings, furniture that stands, things that lie on what carries them."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scenes.appearance.materials import Shares
from scenes.appearance.room_materials import RoomMaterials, wood
from scenes.placement.view import View
from scenes.rooms.clutter import add_things
from scenes.rooms.config import ROOM_KINDS, IndoorConfig
from scenes.rooms.furnishing import furnish
from scenes.rooms.interior import Interior, Placed
from scenes.rooms.lighting import add_outside
from scenes.rooms.plan import Plan, sample_plan
from scenes.rooms.rig import near_share, sample_camera
from scenes.rooms.shell import build_shell
from scenes.shapes.indoor.shell import RoomWall
from scenes.shapes.indoor.storage import Shelf
from scenes.shapes.indoor.tables import Desk, Table
from scenes.spec import SceneObject
from scenes.textures.noise import WoodPlanks

CONFIG = IndoorConfig(things=(20, 60))


def furnished(kind: str, seed: int) -> Interior:
    rng = np.random.default_rng(seed)
    interior = Interior(sample_plan(rng, CONFIG, kind), RoomMaterials(Shares(0.8, 0.2, 0.5, 0.7)))
    build_shell(rng, CONFIG, interior)
    furnish(rng, CONFIG, interior)
    add_things(rng, CONFIG, interior)
    return interior


@pytest.fixture(scope="module")
def interiors() -> list[Interior]:
    return [furnished(kind, seed) for kind in ROOM_KINDS for seed in range(2)]


def corners(thing: SceneObject) -> np.ndarray:
    """(V, 3) vertices in the world."""
    pose = thing.pose(0.0)
    return thing.shape.mesh().vertices @ pose[:3, :3].T + pose[:3, 3]


def bounds(group: tuple[SceneObject, ...]) -> tuple[np.ndarray, np.ndarray]:
    points = np.concatenate([corners(part) for part in group])
    return points.min(axis=0), points.max(axis=0)


def test_a_wall_is_open_where_its_openings_are_and_closed_elsewhere() -> None:
    wall = RoomWall(5.0, 2.6, 0.25, ((0.5, 1.4, 0.0, 2.0), (2.5, 4.0, 0.9, 2.2)), 1.2)
    mesh = wall.mesh()
    points = mesh.vertices * wall.frame.half_extent + wall.frame.centre
    front = points[mesh.triangles]
    front = front[(np.abs(front[:, :, 1]) < 1e-9).all(axis=1)]
    a, b = front[:, 1] - front[:, 0], front[:, 2] - front[:, 0]
    area = np.linalg.norm(np.cross(a, b), axis=1).sum() / 2
    assert area == pytest.approx(5.0 * 2.6 - 0.9 * 2.0 - 1.5 * 1.3)


def test_places_at_a_wall_are_inside_and_face_the_room() -> None:
    plan = Plan("office", 4.0, 3.0, 2.5, ())
    middle = np.array((2.0, 1.5))
    for wall in range(4):
        place = np.array(plan.at_wall(wall, plan.wall_length(wall) / 2, 0.5))
        inward = np.array((-np.sin(plan.yaw(wall)), np.cos(plan.yaw(wall))))
        assert (place > 0).all()
        assert (middle - place) @ inward > 0
        assert np.linalg.norm(plan.at_wall(wall, 1.0) - place) > 0.4


FURNITURE = ("table", "chair", "sofa", "bed", "shelf", "rack", "sideboard", "wardrobe", "desk", "kitchen", "fridge",
             "workbench", "plant", "stool", "armchair", "railing", "stairs", "carton", "basket")  # fmt: skip


def test_furniture_stands_on_the_floor_inside_the_room(interiors: list[Interior]) -> None:
    stood = 0
    for interior in interiors:
        room = np.array((interior.plan.width, interior.plan.depth, interior.plan.height))
        for group in interior.assembly.groups:
            if group[0].name.split()[0] not in FURNITURE or group[0].name.startswith("railing"):
                continue
            low, high = bounds(group)
            assert abs(low[2]) < 1e-6, group[0].name
            assert (low[:2] > -0.01).all(), group[0].name
            assert (high < room + 0.01).all(), group[0].name
            stood += 1
    assert stood > 100


def test_nothing_runs_into_anything_else(interiors: list[Interior]) -> None:
    """Boxes of placed things never overlap, but for what is meant to be inside another thing's box."""
    pairs = 0
    for interior in interiors:
        for one, two in itertools.combinations(interior.placed, 2):
            if not one.extent.meets(two.extent):
                continue
            assert _may_share(one, two), (one, two)
            pairs += 1
    assert pairs > 0


def _may_share(one: Placed, two: Placed) -> bool:
    """Chairs reach under tables; things stand in shelves, on sills and on what has a rim; curtains hang in windows."""
    tucked = isinstance(one.shape, Table | Desk) or isinstance(two.shape, Table | Desk)
    return tucked or bool(one.shape.tops() or two.shape.tops())


def test_things_rest_on_a_top(interiors: list[Interior]) -> None:
    """Every small thing's foot is on the floor or at the height of a top that carries its middle."""
    rested = 0
    for interior in interiors:
        tops = [(base, top) for base in interior.placed for top in base.shape.tops()]
        for group in interior.assembly.groups:
            if group[0].name.split()[0] != "thing":
                continue
            low, high = bounds(group)
            middle = (low + high)[:2] / 2
            heights = [
                base.place[2] + top.z
                for base, top in tops
                if (middle > base.extent.low[:2]).all() and (middle < base.extent.high[:2]).all()
            ]
            assert min(abs(low[2] - height) for height in (0.0, *heights)) < 0.02, group[0].name
            rested += 1
    assert rested > 100


def test_rooms_have_what_their_kind_has(interiors: list[Interior]) -> None:
    expected = {"bedroom": "bed", "kitchen": "kitchen", "office": "desk", "workshop": "workbench", "store room": "rack",
                "stairs": "stairs", "living room": "sofa", "corridor": "door"}  # fmt: skip
    for interior in interiors:
        names = {group[0].name.split()[0] for group in interior.assembly.groups}
        assert {"wall", "floor", "ceiling", "skirting"} <= names
    for kind, name in expected.items():
        rooms = [i for i in interiors if i.plan.kind == kind]
        assert any(group[0].name.startswith(name) for i in rooms for group in i.assembly.groups), kind


def test_the_share_of_a_view_that_near_things_take_up() -> None:
    """A camera in an empty hall sees nothing near; before a board that covers half of its view, it sees that half."""
    interior = Interior(Plan("office", 10.0, 10.0, 6.0, ()), RoomMaterials(Shares(0.8, 0.2, 0.5, 0.7)))
    place, towards_y = np.array((5.0, 2.0, 3.0)), Rotation.from_euler("X", 90.0, degrees=True)
    assert near_share(place, towards_y, (0.8, 0.5), interior) == 0.0
    shelf = Shelf(width=4.0, depth=0.3, height=6.0, levels=4, bays=2, board="lacquer", backed=True)
    interior.put(np.random.default_rng(0), "shelf", shelf, (7.0, 2.8, 0.0))
    assert near_share(place, towards_y, (0.8, 0.5), interior) == pytest.approx(0.5, abs=0.06)
    assert near_share(place, Rotation.from_euler("X", -90.0, degrees=True), (0.8, 0.5), interior) == 0.0


def filled_views(rooms: int) -> int:
    """How many cameras, one in each of some rooms with tall shelves, have half of their view filled by what is near."""
    filled = 0
    for seed in range(rooms):
        rng = np.random.default_rng(seed)
        interior = Interior(Plan("office", 4.5, 4.5, 2.5, ()), RoomMaterials(Shares(0.8, 0.2, 0.5, 0.7)))
        for _ in range(5):
            interior.try_on_floor(rng, "shelf", Shelf(1.4, 0.3, 2.2, 4, 1, "lacquer", True))
        camera = sample_camera(rng, CONFIG, interior)
        pose = camera.pose("left", 0.0)
        turn = Rotation.from_matrix(pose[:3, :3])
        filled += near_share(pose[:3, 3], turn, View(camera, 1).half_view, interior) > 0.5
    return filled


def test_few_cameras_stand_before_something_that_fills_their_view() -> None:
    assert filled_views(16) <= 1


def test_there_is_ground_outside_of_every_wall_with_windows() -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        interior = Interior(sample_plan(rng, CONFIG, "office"), RoomMaterials(Shares(0.8, 0.2, 0.5, 0.7)))
        before = len(interior.assembly.groups)
        add_outside(np.random.default_rng(seed), interior)
        outside = interior.assembly.groups[before:]
        grounds = [corners(group[0]) for group in outside if group[0].name.endswith("ground")]
        walls = {opening.wall for opening in interior.plan.openings if not opening.door}
        assert len(grounds) == len(walls)
        tops = [float(ground[:, 2].max()) for ground in grounds]
        assert len({round(top, 3) for top in tops}) == len(tops)
        assert all(top <= -0.2 + 1e-6 for top in tops)
        room = np.array((interior.plan.width, interior.plan.depth))
        for ground in grounds:
            low, high = ground[:, :2].min(axis=0), ground[:, :2].max(axis=0)
            assert ((high < 0) | (low > room)).any()


def test_joints_between_the_boards_of_furniture_hardly_show() -> None:
    for seed in range(6):
        texture = wood(np.random.default_rng(seed), Shares(0.5, 0.2, 0.5, 0.5)).color
        assert isinstance(texture, WoodPlanks)
        seamless = replace(texture, joint=0.0).image().astype(float)
        assert (texture.image() > 0.85 * seamless - 2.0).all()

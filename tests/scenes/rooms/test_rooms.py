"""Rooms: walls that close around their openings, furniture that stands, things that lie on what carries them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from scenes.appearance.materials import Shares
from scenes.appearance.room_materials import RoomMaterials
from scenes.rooms.clutter import add_things
from scenes.rooms.config import ROOM_KINDS, IndoorConfig
from scenes.rooms.furnishing import furnish
from scenes.rooms.interior import Interior, Placed
from scenes.rooms.plan import Plan, sample_plan
from scenes.rooms.shell import build_shell
from scenes.shapes.indoor.shell import RoomWall
from scenes.shapes.indoor.tables import Desk, Table
from scenes.spec import SceneObject

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

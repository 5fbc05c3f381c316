"""The indoor family: determinism, what the camera sees, what keeps its distance from it, and the config's bounds."""

from __future__ import annotations

import dataclasses
from collections import defaultdict

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from scenes import sample_scene, scene_from_json, scene_to_json
from scenes.families.indoor import IndoorConfig
from scenes.placement.view import camera_positions
from scenes.spec import Scene, SceneObject
from tests.scenes.families.test_driving import corners, disparity_shares

SMALL = IndoorConfig(width=96, height=54, frames=3)
SHELL = ("wall", "floor", "ceiling")


def sampled(seed: int, config: IndoorConfig = SMALL) -> Scene:
    return sample_scene(np.random.default_rng(seed), "indoor", config)


@pytest.fixture(scope="module")
def rooms() -> list[Scene]:
    return [sampled(seed) for seed in range(8)]


def test_the_same_seed_gives_the_same_room_and_it_survives_json(rooms: list[Scene]) -> None:
    assert sampled(2) == rooms[2]
    assert scene_from_json(scene_to_json(rooms[2])) == rooms[2]
    assert len({scene_to_json(scene) for scene in rooms}) == len(rooms)


def test_no_two_rooms_share_a_mesh_or_a_painted_picture(rooms: list[Scene]) -> None:
    """What splits promise: every texture that has a pattern, and every shape with a seed or a measure, is new."""
    shapes: defaultdict[object, set[int]] = defaultdict(set)
    pictures: defaultdict[object, set[int]] = defaultdict(set)
    for number, scene in enumerate(rooms):
        for thing in scene.objects:
            shapes[thing.shape].add(number)
        for material in scene.materials:
            if hasattr(material.color, "seed"):
                pictures[material.color].add(number)
    assert max(map(len, shapes.values())) == 1
    assert max(map(len, pictures.values())) == 1


def test_rooms_have_what_rooms_have() -> None:
    seen: defaultdict[str, int] = defaultdict(int)
    for seed in range(30):
        for kind in {type(thing.shape).__name__ for thing in sampled(seed).objects}:
            seen[kind] += 1
    for kind in ("RoomWall", "RoomSlab", "Skirting"):
        assert seen[kind] >= 25, kind
    for kind in ("Chair", "Table", "Shelf", "BookRow", "Vessel", "Carton", "CeilingLamp", "RoomDoor", "RoomWindow",
                 "Cabinet", "PottedPlant", "WallPicture"):  # fmt: skip
        assert seen[kind] >= 4, kind
    for kind in (
        "Sofa",
        "Blind",
        "Curtain",
        "Radiator",
        "Screen",
        "Basket",
        "Pipes",
        "Rug",
        "Rack",
    ):
        assert seen[kind] >= 1, kind
    kitchens = dataclasses.replace(SMALL, room_kinds=("kitchen",))
    rows = [
        any(type(t.shape).__name__ == "KitchenRow" for t in sampled(k, kitchens).objects) for k in range(6)
    ]
    assert sum(rows) >= 4


def _distance(thing: SceneObject, time_frames: float, points: NDArray[np.float64]) -> float:
    pose = thing.pose(time_frames)
    if np.linalg.norm(points - pose[:3, 3], axis=1).min() > np.linalg.norm(pose[:3, :3]) + 1.0:
        return 1.0
    surface = trimesh.Trimesh(corners(thing, time_frames), thing.shape.mesh().triangles, process=False)
    _, distance, _ = trimesh.proximity.closest_point_naive(surface, points)
    return float(distance.min())


def test_nothing_comes_near_either_camera_at_any_time(rooms: list[Scene]) -> None:
    for scene in rooms[:5]:
        cameras = camera_positions(scene.camera, scene.frames)
        for thing in scene.objects:
            clearance = 0.04 if thing.name.split()[0] in SHELL else 0.9 * SMALL.clearance_m
            for time in (0.0, float(scene.frames - 1)):
                assert _distance(thing, time, cameras) > clearance, thing.name


def test_both_cameras_are_inside_the_room(rooms: list[Scene]) -> None:
    for scene in rooms:
        walls = [corners(t, 0.0) for t in scene.objects if t.name.split()[0] in SHELL]
        inner_low = np.array([0.0, 0.0, 0.0])
        inner_high = np.concatenate(walls).max(axis=0) - 0.25
        for camera in camera_positions(scene.camera, scene.frames):
            assert (camera > inner_low).all()
            assert (camera[:2] < inner_high[:2]).all()


def test_floating_objects_float_free(rooms: list[Scene]) -> None:
    """The box of a floating object touches no other thing's box but that of the room's walls and windows."""
    floated = 0
    for scene in rooms:
        boxes = {}
        for thing in scene.objects:
            if not thing.name.startswith((*SHELL, "skirting", "hallway", "outside")):
                points = corners(thing, (scene.frames - 1) / 2)
                boxes[thing.name] = points.min(axis=0), points.max(axis=0)
        for name, (low, high) in boxes.items():
            if not name.startswith("floating"):
                continue
            floated += 1
            for other, (other_low, other_high) in boxes.items():
                if other != name:
                    assert not ((low < other_high) & (other_low < high)).all(), (name, other)
    assert floated > 5


def test_nothing_is_left_in_the_air_by_leaving_out_what_carries_it(rooms: list[Scene]) -> None:
    rested = 0
    for scene in rooms:
        things: defaultdict[str, list[NDArray[np.float64]]] = defaultdict(list)
        for thing in scene.objects:
            things[" ".join(thing.name.split()[:2])].append(corners(thing, 0.0))
        boxes = {name: np.concatenate(points) for name, points in things.items()}
        ends = {name: (points.min(axis=0), points.max(axis=0)) for name, points in boxes.items()}
        for name, (low, high) in ends.items():
            if not name.startswith(("thing", "television", "screen", "keyboard")) or low[2] < 0.02:
                continue
            middle = (low + high)[:2] / 2
            assert any(
                other != name
                and (middle > other_low[:2]).all()
                and (middle < other_high[:2]).all()
                and other_low[2] < low[2] - 0.01
                and other_high[2] > low[2] - 0.02
                for other, (other_low, other_high) in ends.items()
            ), name
            rested += 1
    assert rested > 40


@pytest.mark.slow
def test_disparities_are_those_of_rooms() -> None:
    still = dataclasses.replace(SMALL, frames=1)
    seen = [disparity_shares(sampled(seed, still)) for seed in range(16)]
    for share in seen:
        assert share.max() <= 1.001 * SMALL.largest_disparity_share
        assert (share == 0).mean() < 0.35  # Sky is seen through open windows only.
    medians = np.array([np.median(share) for share in seen])
    assert 0.02 < np.median(medians) < 0.065
    assert medians.max() > 1.8 * medians.min()
    assert max(np.percentile(share, 99) for share in seen) > 0.12


def test_config_bounds_are_respected() -> None:
    config = dataclasses.replace(
        SMALL,
        room_kinds=("office",),
        floating_objects=(0, 0),
        baseline_m=(0.1, 0.11),
        focal_mm=(20.0, 21.0),
        lamplight_share=1.0,
    )
    for seed in range(3):
        scene = sampled(seed, config)
        assert not any(thing.name.startswith("floating") for thing in scene.objects)
        assert any(thing.name.startswith("desk") for thing in scene.objects)
        assert scene.camera.baseline_m <= 0.11
        assert 20.0 <= scene.camera.focal_mm <= 21.0
        assert scene.notes["daylight"] == 0.0


def test_shares_of_materials_are_fields() -> None:
    def share(config: IndoorConfig) -> float:
        reflective = [m.is_reflective for seed in range(4) for m in sampled(seed, config).materials]
        return float(np.mean(reflective))

    none = dataclasses.replace(
        SMALL, glossy_share=0.0, metallic_share=0.0, transparent_share=0.0, floating_objects=(0, 0)
    )
    every = dataclasses.replace(none, glossy_share=1.0, metallic_share=1.0, transparent_share=1.0)
    assert share(none) < 0.25
    assert share(every) > share(none) + 0.25


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"room_kinds": ("attic",)}, "room_kinds must be some of living room"),
        ({"room_kinds": ()}, "room_kinds must be some of"),
        ({"baseline_m": (0.0, 1.0)}, "baseline_m must be above 0"),
        ({"glossy_share": 1.5}, r"glossy_share must be in 0\.\.1"),
        ({"clearance_m": 0.0}, "clearance_m must be above 0"),
    ],
)
def test_bad_configs_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        IndoorConfig(**change)  # type: ignore[arg-type]

"""The driving family: what every street promises, and the statistics of what the camera sees."""

from __future__ import annotations

import dataclasses
from collections import defaultdict

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from scenes import sample_scene, scene_from_json, scene_to_json
from scenes.families.driving import DrivingConfig
from scenes.shapes.street.cars import CarBody
from scenes.shapes.street.road import Course, RoadStrip
from scenes.shapes.street.vans import VanBody
from scenes.shapes.street.wheels import Wheel
from scenes.spec import Scene, SceneObject

SMALL = DrivingConfig(width=96, height=54)
BRIEF = dataclasses.replace(
    SMALL, frames=5, view_m=(50.0, 60.0), pedestrians_per_100m=(5.0, 9.0), headway_m=(7.0, 15.0)
)
"""Short busy streets."""
UNDERFOOT = ("road", "markings", "centre line", "repairs", "puddles", "plain", "left ", "right ")


def sampled(seed: int, config: DrivingConfig = SMALL) -> Scene:
    return sample_scene(np.random.default_rng(seed), "driving", config)


def corners(thing: SceneObject, time_frames: float) -> NDArray[np.float64]:
    """(V, 3) vertices in the world."""
    pose = thing.pose(time_frames)
    return thing.shape.mesh().vertices @ pose[:3, :3].T + pose[:3, 3]


def street(scene: Scene) -> tuple[Course, RoadStrip]:
    road = next(thing.shape for thing in scene.objects if thing.name == "road")
    assert isinstance(road, RoadStrip)
    return road.course, road


def vehicles(scene: Scene) -> list[SceneObject]:
    return [thing for thing in scene.objects if isinstance(thing.shape, CarBody | VanBody)]


@pytest.fixture(scope="module")
def streets() -> list[Scene]:
    return [sampled(seed, BRIEF) for seed in range(5)]


def test_the_same_seed_gives_the_same_street_and_it_survives_json(streets: list[Scene]) -> None:
    assert sampled(2, BRIEF) == streets[2]
    assert scene_from_json(scene_to_json(streets[2])) == streets[2]
    assert len({scene_to_json(scene) for scene in streets}) == len(streets)


def test_no_two_streets_share_a_course_or_a_picture(streets: list[Scene]) -> None:
    courses = [street(scene)[0] for scene in streets]
    assert len(set(courses)) == len(courses)
    skies = [scene.world.environment for scene in streets]
    roads = [scene.materials[scene.objects[0].material] for scene in streets]
    assert len(set(skies)) == len(set(roads)) == len(streets)


def test_streets_have_what_streets_have() -> None:
    seen: defaultdict[str, int] = defaultdict(int)
    scenes = [sampled(seed) for seed in range(9)]
    for scene in scenes:
        for kind in {type(thing.shape).__name__ for thing in scene.objects}:
            seen[kind] += 1
    for kind in ("RoadStrip", "RoadMarkings", "Kerb", "CarBody", "CarGlass", "Wheel", "LampPost"):
        assert seen[kind] == len(scenes), kind
    for kind in ("HouseWalls", "HouseWindows", "TreeCrown", "PersonTop", "SignFace", "Fence", "VanBody"):
        assert seen[kind] >= 2, kind
    focal = {scene.camera.focal_mm for scene in scenes}
    speeds = np.array([scene.notes["speed_m"] for scene in scenes])
    assert len(focal) >= 4
    assert focal <= set(DrivingConfig().focal_lengths_mm)
    assert (speeds > 0).any()
    assert (speeds < 0).any()
    assert (np.abs(speeds) < 0.51).any()
    assert (np.abs(speeds) > 0.69).any()


def test_everything_stands_on_the_ground(streets: list[Scene]) -> None:
    """The lowest point of every thing but roofs, crowns, windows and the like is within a step of the ground."""
    standing = (
        "wheel",
        "post",
        "stem",
        "walls",
        "legs",
        "bench",
        "bin",
        "bollard",
        "cabinet",
        "fence",
        "shrub",
    )
    checked = 0
    for scene in streets:
        for thing in scene.objects:
            if thing.name.startswith(UNDERFOOT) or not any(word in thing.name for word in standing):
                continue
            lowest = corners(thing, 0.0)[:, 2].min()
            assert -0.45 < lowest < 0.2, thing.name
            checked += 1
    assert checked > 200


def test_vehicles_are_on_the_road_and_point_along_it(streets: list[Scene]) -> None:
    for scene in streets:
        course, road = street(scene)
        for thing in vehicles(scene):
            for time in (0.0, float(scene.frames - 1)):
                place = course.locate(corners(thing, time)[:, :2])
                assert place[:, 1].max() < road.left_m + 0.1, thing.name
                assert place[:, 1].min() > road.right_m - 0.1, thing.name
                forward = thing.motion.pose(time)[:2, 0]
                heading = float(course.heading(float(place[:, 0].mean())))
                assert abs(forward @ (np.cos(heading), np.sin(heading))) > 0.995


def footprint(thing: SceneObject, time_frames: float) -> NDArray[np.float64]:
    plan = corners(thing, time_frames)[:, :2]
    return plan[ConvexHull(plan).vertices]


def overlap(one: NDArray[np.float64], two: NDArray[np.float64]) -> bool:
    """Whether two convex polygons meet: no edge of either separates them."""
    for polygon in (one, two):
        normals = (np.roll(polygon, -1, axis=0) - polygon) @ np.array([(0.0, -1.0), (1.0, 0.0)])
        a, b = one @ normals.T, two @ normals.T
        if ((a.max(axis=0) < b.min(axis=0)) | (b.max(axis=0) < a.min(axis=0))).any():
            return False
    return True


def test_no_vehicle_runs_into_another(streets: list[Scene]) -> None:
    pairs = 0
    for scene in streets:
        for time in (0.0, float(scene.frames - 1)):
            plans = [footprint(thing, time) for thing in vehicles(scene)]
            for i, one in enumerate(plans):
                for two in plans[:i]:
                    assert not overlap(one, two)
                    pairs += 1
    assert pairs > 100


def test_wheels_roll_without_slipping(streets: list[Scene]) -> None:
    rolled = 0
    for scene in streets:
        for thing in scene.objects:
            if not isinstance(thing.shape, Wheel) or len(thing.motion.times_frames) == 1:
                continue
            one, two = thing.motion.pose(1.0), thing.motion.pose(1.02)
            travel = np.linalg.norm(two[:3, 3] - one[:3, 3])
            turn = one[:3, :3].T @ two[:3, :3]
            angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
            assert angle * thing.shape.radius == pytest.approx(travel, rel=0.05)
            # The top of a wheel runs ahead of its hub.
            forward = (two - one)[:3, 3]
            top = one[:3, :3].T @ np.array((0.0, 0.0, 1.0))
            assert ((two[:3, :3] - one[:3, :3]) @ top) @ forward > 0
            rolled += 1
    assert rolled > 20


def test_nothing_comes_near_either_camera_at_any_time(streets: list[Scene]) -> None:
    for scene in streets:
        for time in np.linspace(-0.5, scene.frames - 0.5, 6):
            cameras = np.stack([scene.camera.pose(view, time)[:3, 3] for view in ("left", "right")])
            assert cameras[:, 2].min() > 0.9 * BRIEF.camera_height_m[0]
            for thing in scene.objects:
                if thing.name.startswith(UNDERFOOT):
                    continue
                pose = thing.pose(time)
                middle, reach = pose[:3, 3], np.linalg.norm(pose[:3, :3])
                if np.linalg.norm(cameras - middle, axis=1).min() > reach + BRIEF.clearance_m:
                    continue
                surface = trimesh.Trimesh(corners(thing, time), thing.shape.mesh().triangles, process=False)
                _, distance, _ = trimesh.proximity.closest_point_naive(surface, cameras)
                assert distance.min() > BRIEF.clearance_m, thing.name


def test_config_bounds_are_respected() -> None:
    config = dataclasses.replace(
        SMALL,
        focal_lengths_mm=(20.0,),
        baseline_m=(0.2, 0.3),
        camera_height_m=(1.5, 1.6),
        lanes=(2, 2),
        lane_m=(3.0, 3.1),
        pedestrians_per_100m=(0.0, 0.0),
        backwards_share=1.0,
        fast_share=0.0,
        view_m=(60.0, 61.0),
        frames=3,
    )
    for seed in range(4):
        scene = sampled(seed, config)
        course, road = street(scene)
        assert scene.camera.focal_mm == 20.0
        assert 0.2 <= scene.camera.baseline_m <= 0.3
        assert 1.45 < scene.camera.pose("left", 1.0)[2, 3] < 1.65
        assert scene.notes["lanes"] == 4
        assert road.left_m - road.right_m > 4 * 3.0
        assert -config.slow_m[1] <= scene.notes["speed_m"] <= -config.slow_m[0]
        assert not any(thing.name.startswith("person") for thing in scene.objects)
        # Backwards: the rig leaves what it looks at.
        step = scene.camera.pose("left", 2.0)[:3, 3] - scene.camera.pose("left", 0.0)[:3, 3]
        assert step @ -scene.camera.pose("left", 1.0)[:3, 2] < 0
        assert course.end_m >= 60.0


def disparity_shares(scene: Scene, time_frames: float = 0.0) -> NDArray[np.float64]:
    """(H, W) disparity of the left view as a share of the image width, by trimesh's ray caster; 0 for sky."""
    camera = scene.camera
    to_left = np.linalg.inv(camera.pose("left", time_frames))
    triangles = np.concatenate([corners(t, time_frames)[t.shape.mesh().triangles] for t in scene.objects])
    local = triangles.reshape(-1, 3) @ to_left[:3, :3].T + to_left[:3, 3]
    world = trimesh.Trimesh(local, np.arange(len(local)).reshape(-1, 3), process=False)
    x = (np.arange(camera.width) + 0.5 - camera.width / 2) / camera.focal_px
    y = (camera.height / 2 - np.arange(camera.height) - 0.5) / camera.focal_px
    rays = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), -1).reshape(-1, 3)
    triangle = world.ray.intersects_first(np.zeros_like(rays), rays)
    hit = triangle >= 0
    a, b, c = (world.triangles[triangle[hit], k] for k in range(3))
    normal = np.cross(b - a, c - a)
    depth = (normal * a).sum(1) / (normal * rays[hit]).sum(1)
    share = np.zeros(len(rays))
    share[hit] = camera.disparity_metres / depth / camera.width
    return share.reshape(camera.height, camera.width)


@pytest.mark.slow
def test_disparities_are_those_of_a_street() -> None:
    seen = [disparity_shares(sampled(seed)) for seed in range(10)]
    for share in seen:
        assert share.max() <= 1.001 * SMALL.largest_disparity_share
        assert np.median(share[-3:]) > 0.03
        assert np.percentile(share, 90) > 0.015
    # The road: near at the bottom, farther above, unless a wall or a vehicle close by fills the middle.
    rises = [np.median(share[-3:]) > 2 * np.median(share[len(share) // 2 :][:3]) for share in seen]
    assert np.mean(rises) >= 0.8
    everything = np.concatenate([share.ravel() for share in seen])
    low, middle, high = np.percentile(everything, (5, 50, 99))
    assert low == 0.0  # sky
    assert 0.01 < middle < 0.06
    assert 0.07 < high < 0.2
    assert 0.03 < np.mean(everything == 0.0) < 0.45


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lane_m": (4.0, 3.0)}, r"lane_m must be \(low, high\)"),
        ({"baseline_m": (0.0, 1.0)}, "baseline_m must be above 0"),
        ({"dusk_share": 1.5}, r"dusk_share must be in 0\.\.1"),
        ({"focal_lengths_mm": ()}, "focal_lengths_mm must be above 0"),
        ({"frames": 0}, "frames must be at least 1"),
    ],
)
def test_bad_configs_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DrivingConfig(**change)  # type: ignore[arg-type]


def test_a_course_is_measured_in_metres_and_located_back() -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        course = Course.sample(rng, -30.0, 170.0, 30.0)
        s = np.linspace(-25.0, 165.0, 400)
        line = course.point(s, 0.0)
        length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        assert length == pytest.approx(190.0, rel=1e-3)
        places = np.column_stack([s, rng.uniform(-8.0, 8.0, len(s))])
        np.testing.assert_allclose(course.locate(course.point(*places.T)), places, atol=0.03)
        np.testing.assert_allclose(course.point(0.0, 0.0), (0.0, 0.0), atol=1e-9)

"""The flying_things family: what every scene promises, and statistics of where things are."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from scenes import sample_scene
from scenes.families.flying_things import FlyingThingsConfig
from scenes.spec import Scene

SMALL = FlyingThingsConfig(width=96, height=54)


def sampled(seed: int, config: FlyingThingsConfig = SMALL) -> Scene:
    return sample_scene(np.random.default_rng(seed), "flying_things", config)


def world_corners(scene: Scene, index: int, time_frames: float) -> NDArray[np.float64]:
    """(F, 3, 3) triangles of one object in the world."""
    thing = scene.objects[index]
    mesh, pose = thing.shape.mesh(), thing.pose(time_frames)
    return (mesh.vertices @ pose[:3, :3].T + pose[:3, 3])[mesh.triangles]


def winding_number(corners: NDArray[np.float64], point: NDArray[np.float64]) -> float:
    """How often a closed surface encloses a point: van Oosterom and Strackee 1983."""
    a, b, c = (corners[:, k] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    determinant = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float((2 * np.arctan2(determinant, below)).sum() / (4 * np.pi))


@dataclass(frozen=True)
class FirstHits:
    """First hits of the rays through the pixels' centres."""

    share: NDArray[np.float64]
    """(H, W) disparity as a share of the image width, 0 for the sky."""
    index: NDArray[np.int64]
    """(H, W) object index, -1 for the sky."""


def first_hits(scene: Scene, time_frames: float) -> FirstHits:
    """What the left view shows, by trimesh's ray caster."""
    camera = scene.camera
    corners = [world_corners(scene, k, time_frames) for k in range(len(scene.objects))]
    to_eye = np.linalg.inv(camera.pose("left", time_frames))
    local = np.concatenate(corners).reshape(-1, 3) @ to_eye[:3, :3].T + to_eye[:3, 3]
    world = trimesh.Trimesh(local, np.arange(len(local)).reshape(-1, 3), process=False)
    x = (np.arange(camera.width) + 0.5 - camera.width / 2) / camera.focal_px
    y = (camera.height / 2 - np.arange(camera.height) - 0.5) / camera.focal_px
    rays = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), -1).reshape(-1, 3)
    triangle = world.ray.intersects_first(np.zeros_like(rays), rays)
    hit = triangle >= 0
    a, b, c = (world.triangles[triangle[hit], k] for k in range(3))
    normal = np.cross(b - a, c - a)
    depth = (normal * a).sum(1) / (normal * rays[hit]).sum(1)
    share, index = np.zeros(len(rays)), np.full(len(rays), -1)
    share[hit] = camera.disparity_metres / depth / camera.width
    index[hit] = np.repeat(np.arange(len(corners)), [len(part) for part in corners])[triangle[hit]]
    shape = (camera.height, camera.width)
    return FirstHits(share.reshape(shape), index.reshape(shape))


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), frames=st.integers(1, 40))
def test_neither_camera_is_ever_inside_or_near_anything(seed: int, frames: int) -> None:
    config = dataclasses.replace(SMALL, frames=frames, background_objects=(10, 15))
    scene = sampled(seed, config)
    nearest_m = scene.camera.disparity_metres / (config.disparity_share[1] * config.width)
    for time in np.linspace(-0.5, frames - 0.5, 3):
        for view in ("left", "right"):
            position = scene.camera.pose(view, time)[:3, 3]
            for index in range(len(scene.objects)):
                corners = world_corners(scene, index, time)
                assert abs(winding_number(corners, position)) < 0.01
                assert np.linalg.norm(corners - position, axis=2).min() > 0.25 * nearest_m


def test_the_winding_number_sees_a_camera_inside() -> None:
    box = np.array(trimesh.creation.box().triangles)
    assert winding_number(box, np.array([0.1, 0.2, -0.3])) == pytest.approx(1.0)
    assert winding_number(box, np.array([0.1, 0.2, -0.6])) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=6, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    frames=st.integers(1, 30),
    size=st.sampled_from([(96, 54), (54, 96), (128, 40), (33, 31)]),
)
def test_no_flyer_is_nearer_than_allowed_at_any_time(seed: int, frames: int, size: tuple[int, int]) -> None:
    config = FlyingThingsConfig(width=size[0], height=size[1], frames=frames, background_objects=(5, 5))
    scene = sampled(seed, config)
    nearest_m = scene.camera.disparity_metres / (config.disparity_share[1] * config.width)
    flyers = [k for k, thing in enumerate(scene.objects) if thing.name.startswith("flying")]
    for time in np.linspace(0, frames - 1, min(frames, 5)):
        camera = scene.camera.pose("left", time)
        for index in flyers:
            depth = (world_corners(scene, index, time) - camera[:3, 3]) @ -camera[:3, 2]
            assert depth.min() > 0.999 * nearest_m


def test_counts_focal_length_and_baseline_are_in_the_ranges_asked_for() -> None:
    config = FlyingThingsConfig(
        flying_objects=(3, 4),
        background_objects=(7, 9),
        focal_mm=(20.0, 50.0),
        baseline_m=(0.1, 0.5),
        frames=4,
    )
    focal, baseline = [], []
    for seed in range(10):
        scene = sampled(seed, config)
        names = [thing.name.split()[0] for thing in scene.objects]
        assert names.count("ground") == 1
        assert 7 <= names.count("background") <= 9
        assert 3 <= names.count("flying") <= 4
        assert scene.frames == 4
        focal.append(scene.camera.focal_mm)
        baseline.append(scene.camera.baseline_m)
    assert 20 <= min(focal) < 30 < 40 < max(focal) <= 50
    assert 0.1 <= min(baseline) < 0.25 < 0.35 < max(baseline) <= 0.5


def test_rows_are_of_equal_things_that_stand_on_the_ground_beyond_what_flies_nearest() -> None:
    config = dataclasses.replace(SMALL, background_objects=(1, 1), flying_objects=(1, 1), rows=(2, 2))
    for seed in range(4):
        scene = sampled(seed, config)
        nearest_m = scene.camera.disparity_metres / (config.disparity_share[1] * config.width)
        for name in ("row 0 ", "row 1 "):
            things = [k for k, thing in enumerate(scene.objects) if thing.name.startswith(name)]
            row = [scene.objects[k] for k in things]
            assert len(row) >= 2
            assert len({(thing.shape, thing.material, thing.scale_m) for thing in row}) == 1
            places = np.array([thing.motion.positions_m[0] for thing in row])[:, :2]
            np.testing.assert_allclose(np.diff(places, 2, axis=0), 0, atol=1e-6)
            pose = scene.camera.pose("left", 0.0)
            for k in things:
                assert ((world_corners(scene, k, 0.0) - pose[:3, 3]) @ -pose[:3, 2]).min() > nearest_m


def test_lattices_are_as_many_as_asked_for() -> None:
    for share in (0.0, 0.9):
        config = dataclasses.replace(SMALL, lattice_share=share, rows=(0, 0))
        kinds = [type(thing.shape).__name__ for seed in range(2) for thing in sampled(seed, config).objects]
        found = np.mean([kind in ("Lattice", "WireFrame", "HoledPlate", "Spring") for kind in kinds])
        assert share - 0.1 < found < share + 0.15
    with pytest.raises(ValueError, match="at most 1 together"):
        FlyingThingsConfig(glossy_share=0.9, metallic_share=0.2)


def test_everything_scales_with_the_baseline() -> None:
    wide, narrow = (
        first_hits(sampled(3, dataclasses.replace(SMALL, baseline_m=(b, b))), 0.0).share for b in (1.0, 0.01)
    )
    assert np.mean(np.abs(wide - narrow) > 1e-4) < 0.01


def test_the_published_rig_is_that_of_flying_things_3d() -> None:
    camera = sampled(0, FlyingThingsConfig(focal_mm=(35.0, 35.0), baseline_m=(1.0, 1.0))).camera
    assert (camera.width, camera.height) == (960, 540)
    assert camera.disparity_metres == 1050.0


def test_lenses_and_baselines_are_wide_by_default() -> None:
    """Fields of view from 30 to 80 degrees, and baselines from a phone's to a car's."""
    cameras = [sampled(seed, SMALL).camera for seed in range(12)]
    fields = [2 * np.degrees(np.arctan2(camera.width / 2, camera.focal_px)) for camera in cameras]
    assert 29 < min(fields) < 40
    assert 60 < max(fields) < 84
    baselines = [camera.baseline_m for camera in cameras]
    assert min(baselines) < 0.3
    assert max(baselines) > 0.7


def test_the_same_seed_gives_the_same_scene() -> None:
    assert sampled(11) == sampled(11)
    assert sampled(11) != sampled(12)


def test_no_two_scenes_share_a_texture_or_a_mesh() -> None:
    # As the data sets spawn them: one seed sequence, a child for each split and scene.
    scenes = [
        sample_scene(np.random.default_rng(child), "flying_things", SMALL)
        for split in np.random.SeedSequence(0).spawn(3)
        for child in split.spawn(4)
    ]
    shapes = [{thing.shape for thing in scene.objects} for scene in scenes]
    textures = [{m.color for m in scene.materials} | {scene.world.environment} for scene in scenes]
    for i in range(len(scenes)):
        for j in range(i):
            assert not shapes[i] & shapes[j]
            assert not textures[i] & textures[j]


def test_every_flyer_has_its_own_material_and_background_objects_share_theirs() -> None:
    scene = sampled(4)
    worn = {
        kind: [t.material for t in scene.objects if t.name.startswith(kind)]
        for kind in ("flying", "background")
    }
    assert len(set(worn["flying"])) == len(worn["flying"])
    assert len(set(worn["background"])) <= SMALL.background_materials[1]
    assert not set(worn["flying"]) & set(worn["background"])


@pytest.mark.slow
def test_what_the_camera_sees_over_many_scenes() -> None:
    """Flyers cover a third to a half of the image, the range of disparities is used, nothing dominates."""
    flying, largest, medians, everything, above = [], [], [], [], []
    for seed in range(10):
        scene = sampled(seed)
        seen = first_hits(scene, 0.0)
        first = next(k for k, thing in enumerate(scene.objects) if thing.name.startswith("flying"))
        flying.append(np.mean(seen.index >= first))
        largest.append(max(np.mean(seen.index == k) for k in range(first, len(scene.objects))))
        medians.append(np.median(seen.share))
        above.append(np.mean(seen.share > 1.001 * SMALL.disparity_share[1]))
        everything.append(seen.share.ravel())
        assert np.mean(seen.index == 0) < 0.9
    assert 0.3 < np.mean(flying) < 0.5
    assert np.min(flying) > 0.05
    assert np.max(largest) < 0.4
    assert np.max(above) < 0.01
    shares = np.concatenate(everything)
    shares = shares[shares > 0]
    # Every sixth of the range up to the nearest allowed disparity holds a fair part of the pixels.
    histogram, _ = np.histogram(shares, np.linspace(0, SMALL.disparity_share[1], 7))
    assert (histogram / len(shares) > 0.03).all()
    assert np.std(medians) > 0.005


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"focal_mm": (50.0, 35.0)}, r"focal_mm must be \(low, high\)"),
        ({"baseline_m": (0.0, 1.0)}, "baseline_m must be above 0"),
        ({"frames": 0}, "frames must be at least 1"),
    ],
)
def test_bad_configs_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        FlyingThingsConfig(**change)  # type: ignore[arg-type]

"""Trajectories and cameras against scipy and closed forms."""

from __future__ import annotations

import dataclasses
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from scenes.motion.trajectories import exposure_times, key_times, quaternion, shifted, wander
from scenes.shapes.solids.basic import Box
from scenes.spec import SceneObject, StereoCamera, Texture, Trajectory
from scenes.textures.plain import SolidColor
from stereoforge_kit import discovery

seeds = st.integers(0, 2**32 - 1)


def test_two_keys_are_a_straight_line_and_a_slerp() -> None:
    ends = Rotation.from_euler("xyz", [(10, 20, 30), (50, -20, 100)], degrees=True)
    motion = Trajectory((0.0, 4.0), ((0.0, 0.0, 0.0), (4.0, 8.0, -2.0)), tuple(map(quaternion, ends)))
    slerp = Slerp([0.0, 4.0], ends)
    for time in np.linspace(0, 4, 9):
        pose = motion.pose(time)
        np.testing.assert_allclose(pose[:3, 3], np.array([1.0, 2.0, -0.5]) * time, atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3], slerp(time).as_matrix(), atol=1e-9)
        np.testing.assert_array_equal(pose[3], (0, 0, 0, 1))


@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_a_trajectory_passes_through_its_keys_and_holds_at_its_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rotations = Rotation.random(4, random_state=rng)
    positions = rng.normal(size=(4, 3))
    times = np.cumsum(rng.uniform(0.5, 2.0, 4))
    motion = Trajectory(
        tuple(times.tolist()), tuple(map(tuple, positions.tolist())), tuple(map(quaternion, rotations))
    )
    for time, position, rotation in zip(times, positions, rotations, strict=True):
        np.testing.assert_allclose(motion.pose(time)[:3, 3], position, atol=1e-9)
        np.testing.assert_allclose(motion.pose(time)[:3, :3], rotation.as_matrix(), atol=1e-7)
    np.testing.assert_array_equal(motion.pose(times[0] - 5), motion.pose(times[0]))
    np.testing.assert_array_equal(motion.pose(times[-1] + 5), motion.pose(times[-1]))


def test_a_moving_trajectory_is_smooth() -> None:
    motion = wander(np.random.default_rng(0), 40, np.zeros(3), Rotation.identity(), speed_m=0.1, turn_deg=5.0)
    poses = np.array([motion.pose(time) for time in np.linspace(0, 39, 400)])
    steps = np.diff(poses, axis=0)
    # Twice as many steps halve the change from one step to the next: no jumps.
    assert np.abs(np.diff(steps, axis=0)).max() < 0.1 * np.abs(steps).max()


@settings(max_examples=30, deadline=None)
@given(seed=seeds, frames=st.integers(1, 300))
def test_wandering_stays_within_reach_at_about_the_speed_asked_for(seed: int, frames: int) -> None:
    rng = np.random.default_rng(seed)
    motion = wander(rng, frames, np.ones(3), Rotation.identity(), speed_m=0.3, turn_deg=2.0, reach_m=1.0)
    times = np.linspace(0, frames - 1, 50) if frames > 1 else np.array([0.0])
    offsets = np.array([motion.pose(time)[:3, 3] for time in times]) - 1.0
    # A cubic spline overshoots its keys a little.
    assert np.linalg.norm(offsets, axis=1).max() < 1.8
    velocity = [np.linalg.norm(motion.pose(t + 0.01)[:3, 3] - motion.pose(t)[:3, 3]) / 0.01 for t in times]
    assert np.median(velocity) < 0.8


@pytest.mark.parametrize("frames", [1, 2, 10, 100])
def test_keys_enclose_the_frames_and_the_shutter(frames: int) -> None:
    times, checked = key_times(frames), exposure_times(frames)
    assert times[0] == -1.0
    assert times[-1] == frames
    assert checked.min() == -0.5
    assert checked.max() == frames - 0.5
    assert len(times) >= 2


def test_shifting_moves_every_instant() -> None:
    rng = np.random.default_rng(1)
    motion = wander(rng, 20, np.zeros(3), Rotation.identity(), speed_m=1.0, turn_deg=3.0)
    moved = shifted(motion, np.array([1.0, -2.0, 3.0]))
    for time in (0.0, 7.3, 19.0):
        np.testing.assert_allclose(moved.pose(time)[:3, 3] - motion.pose(time)[:3, 3], (1, -2, 3), atol=1e-9)
        np.testing.assert_array_equal(moved.pose(time)[:3, :3], motion.pose(time)[:3, :3])


def test_bad_trajectories_are_refused() -> None:
    with pytest.raises(ValueError, match="as many positions"):
        Trajectory((0.0, 1.0), ((0.0, 0.0, 0.0),), ((1.0, 0.0, 0.0, 0.0),))
    with pytest.raises(ValueError, match="must increase"):
        Trajectory((0.0, 0.0), ((0.0, 0.0, 0.0),) * 2, ((1.0, 0.0, 0.0, 0.0),) * 2)


def test_the_right_view_is_a_baseline_to_the_right() -> None:
    turn = Rotation.from_euler("xyz", (80, 5, 30), degrees=True)
    camera = StereoCamera(960, 540, 35.0, 0.25, Trajectory.static((1.0, 2.0, 3.0), quaternion(turn)))
    left, right = camera.pose("left", 0.0), camera.pose("right", 0.0)
    np.testing.assert_allclose(right[:3, 3] - left[:3, 3], turn.apply((0.25, 0.0, 0.0)))
    np.testing.assert_array_equal(right[:3, :3], left[:3, :3])
    assert camera.focal_px == 1050.0
    assert camera.disparity_metres == 262.5
    with pytest.raises(ValueError, match="'middle'"):
        camera.pose("middle", 0.0)
    with pytest.raises(ValueError, match="baseline_m must be positive"):
        dataclasses.replace(camera, baseline_m=0.0)


def test_an_objects_pose_scales_before_it_turns() -> None:
    quarter = quaternion(Rotation.from_euler("z", 90, degrees=True))
    thing = SceneObject(
        "box", Box((1.0, 1.0, 1.0)), 0, Trajectory.static((5.0, 0.0, 0.0), quarter), (2.0, 3.0, 4.0)
    )
    np.testing.assert_allclose(thing.pose(0.0) @ (1, 0, 0, 1), (5, 2, 0, 1), atol=1e-12)
    np.testing.assert_allclose(thing.pose(0.0) @ (0, 1, 1, 1), (2, 0, 4, 1), atol=1e-12)


def test_two_plug_ins_of_one_name_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files say which kind a record is by its name alone: a second one would silently take its place."""
    one, two = ModuleType("scenes.textures.one"), ModuleType("scenes.textures.two")
    for module in (one, two):
        member = type("Twin", (SolidColor,), {"__module__": module.__name__})
        monkeypatch.setattr(module, "Twin", member, raising=False)
    monkeypatch.setattr(discovery, "modules_in", lambda _: [one, two])
    with pytest.raises(TypeError, match=r"one and scenes\.textures\.two both define Twin"):
        discovery.concrete_subclasses(one, Texture)  # type: ignore[type-abstract]

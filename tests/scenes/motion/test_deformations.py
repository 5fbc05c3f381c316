"""Non-rigid motions: smooth in time, bounded, the same point of the surface throughout."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from scenes.landscapes.characters import Character
from scenes.landscapes.creatures import Coat, sample_creature
from scenes.landscapes.people import sample_person
from scenes.motion.deformations import DEFORMATIONS
from scenes.motion.deformations.articulated import Articulated, Joint
from scenes.motion.deformations.sway import Sway
from scenes.serialization import from_plain, to_plain
from scenes.spec import Deformation

seeds = st.integers(0, 2**32 - 1)

ARM = (
    Joint(-1, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1, (0.0, 0.0, 1.0), 30.0),
    Joint(0, (1.0, 0.0, 0.0), (2.0, 0.0, 0.0), 0.1, (0.0, 0.0, 1.0), 60.0),
)
"""A bent arm: at a quarter of its period the upper arm points 30, the forearm 90 degrees from the x axis."""


def character(seed: int) -> Character:
    rng = np.random.default_rng(seed)
    return sample_creature(rng, Coat(100, 0.05, 24)) if seed % 2 else sample_person(rng, 24)


def test_joints_turn_what_hangs_on_them_as_worked_out_by_hand() -> None:
    arm = Articulated(ARM, period_frames=4.0, softness=1e-3)
    points = np.array([(0.5, 0.0, 0.0), (1.5, 0.0, 0.0), (2.0, 0.0, 0.0)])
    np.testing.assert_allclose(arm.deformed(points, 0.0), points, atol=1e-12)
    elbow = np.array((np.cos(np.radians(30)), 0.5, 0.0))
    up = np.array((0.0, 1.0, 0.0))
    expected = [0.5 * elbow, elbow + 0.5 * up, elbow + up]
    np.testing.assert_allclose(arm.deformed(points, 1.0), expected, atol=1e-9)


def test_a_carried_mesh_moves_rigidly_with_its_joint() -> None:
    hand = Articulated(ARM, period_frames=4.0, centre=(2.0, 0.0, 0.0), unit=0.2, carried_by=1)
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    moved = hand.deformed(points, 1.0)
    turn = np.array([(0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    np.testing.assert_allclose(moved - moved[0], (points - points[0]) @ turn.T, atol=1e-9)


def test_parts_of_one_body_move_as_one_whatever_their_mesh_coordinates() -> None:
    whole = Articulated(ARM, period_frames=7.0)
    part = dataclasses.replace(whole, centre=(0.7, -0.2, 0.1), unit=0.3)
    points = np.random.default_rng(1).uniform(-1, 2, (30, 3))
    own = (points - part.centre) / part.unit
    for time in (0.0, 1.3, 5.0):
        same = part.deformed(own, time) * part.unit + part.centre
        np.testing.assert_allclose(same, whole.deformed(points, time), atol=1e-9)


@settings(max_examples=12, deadline=None)
@given(seed=seeds, time=st.floats(-5.0, 200.0))
def test_the_lowest_foot_of_a_character_stays_on_the_ground(seed: int, time: float) -> None:
    body = character(seed)
    if not body.feet:
        return
    motion = Articulated(body.joints, body.period_frames, feet=body.feet)
    moves = motion.poses(time)
    ends = np.array([(*body.joints[foot].end, 1.0) for foot in body.feet])
    rise = np.einsum("fij,fj->fi", moves[list(body.feet)], ends)[:, 2] - ends[:, 2]
    # The smooth minimum lies up to log(feet) / sharpness above the lowest foot.
    assert -0.011 < rise.min() < 1e-9


def _step(motion: Deformation, rest: NDArray[np.float64], time: float, by: float) -> NDArray[np.float64]:
    return motion.deformed(rest, time + by) - motion.deformed(rest, time)


@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_characters_move_smoothly_and_not_far(seed: int) -> None:
    body = character(seed)
    part = body.parts[0]
    motion = body.deformation(part)
    rest = part.shape.mesh().vertices[::7]
    reach = 0.0
    for time in np.linspace(0.0, body.period_frames, 9):
        moved = motion.deformed(rest, time)
        reach = max(reach, float(np.abs(moved - rest).max()))
        # Half the time step, half the way: there is a velocity, and it is bounded.
        whole, half = _step(motion, rest, time, 0.02), _step(motion, rest, time, 0.01)
        # At its slowest a body moves by micrometres, which its acceleration is not small against.
        assert np.abs(whole - 2 * half).max() < 0.02 * np.abs(whole).max() + 1e-6
        assert np.abs(whole).max() / 0.02 < 0.5
    assert 0.005 < reach < 1.5


@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_a_characters_skin_is_stretched_only_about_its_joints(seed: int) -> None:
    body = character(seed)
    part = body.parts[0]
    mesh, motion = part.shape.mesh(), body.deformation(part)
    edges = mesh.triangles[:, [0, 1]]
    moved = motion.deformed(mesh.vertices, 0.27 * body.period_frames)
    before, after = (np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1) for v in (mesh.vertices, moved))
    ratio = after / np.maximum(before, 1e-9)
    assert np.median(np.abs(ratio - 1)) < 0.15
    assert np.percentile(ratio, 99) < 3.0


def test_sway_leaves_the_root_and_moves_the_tip_by_its_amplitude() -> None:
    grass = Sway(amplitude=0.3, direction_deg=90.0, period_frames=8.0, root=-0.5, tip=1.0)
    points = np.array([(0.0, 0.0, -1.0), (0.0, 0.0, -0.5), (0.0, 0.0, 0.25), (0.0, 0.0, 1.0)])
    moved = grass.deformed(points, 2.0) - points
    np.testing.assert_allclose(moved[:, 1], [0.0, 0.0, 0.075, 0.3], atol=1e-12)
    np.testing.assert_allclose(moved[:, [0, 2]], 0.0, atol=1e-12)
    np.testing.assert_allclose(grass.deformed(points, 8.0), grass.deformed(points, 0.0), atol=1e-9)


def test_what_hangs_sways_at_its_lower_end() -> None:
    vine = Sway(amplitude=0.2, direction_deg=0.0, period_frames=4.0, root=1.0, tip=-1.0)
    points = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    np.testing.assert_allclose(vine.deformed(points, 1.0)[:, 0], [0.0, 0.2], atol=1e-12)


@pytest.mark.parametrize(
    "motion", [Sway(0.1, 20.0, 30.0, 0.2, -0.9, 0.8), character(3).deformation(character(3).parts[0])]
)
def test_a_deformation_survives_json(motion: Deformation) -> None:
    kind = DEFORMATIONS[type(motion).__name__]
    assert from_plain(json.loads(json.dumps(to_plain(motion))), kind) == motion

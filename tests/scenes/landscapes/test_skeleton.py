"""Poses as geometry: where limbs end, worked out by hand; that bodies stand on the ground."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.landscapes.people import sample_person
from scenes.landscapes.poses import LOW, STANDING, ArmPose, LegPose, sample_pose
from scenes.landscapes.skeleton import GROUND, Gait, Skeleton, turned
from scenes.shapes.nature.soft_bodies import SoftBody

STILL = Gait(False, 0.0, 0.0, 0.0, 0.0, 20.0, 0.0)


def arm(pose: ArmPose, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Elbow and wrist, relative to the shoulder, of an arm of two pieces of length 1."""
    body = Skeleton(STILL)
    upper = body.joint(GROUND, (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), 0.1, turn=pose.shoulder(side))
    body.joint(upper, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.1, turn=pose.elbow_turn())
    elbow, wrist = (np.array(joint.end) - (0.0, 0.0, 2.0) for joint in body.joints)
    return elbow, wrist


@pytest.mark.parametrize(
    ("pose", "side", "elbow", "wrist"),
    [
        (ArmPose(0.0, 0.0, 0.0, 0.0, 0.0), 1.0, (0, 0, -1), (0, 0, -2)),
        (ArmPose(90.0, 0.0, 0.0, 0.0, 0.0), 1.0, (1, 0, 0), (2, 0, 0)),
        (ArmPose(0.0, 90.0, 0.0, 0.0, 0.0), 1.0, (0, 1, 0), (0, 2, 0)),
        (ArmPose(0.0, 90.0, 0.0, 0.0, 0.0), -1.0, (0, -1, 0), (0, -2, 0)),
        (ArmPose(0.0, 0.0, 0.0, 0.0, 90.0), 1.0, (0, 0, -1), (1, 0, -1)),
        (ArmPose(90.0, 0.0, 90.0, 0.0, 0.0), 1.0, (0, -1, 0), (0, -2, 0)),
        (ArmPose(0.0, 0.0, 0.0, 90.0, 90.0), 1.0, (0, 0, -1), (0, -1, -1)),
        (ArmPose(0.0, 0.0, 0.0, 90.0, 90.0), -1.0, (0, 0, -1), (0, 1, -1)),
    ],
)
def test_arms_end_where_their_angles_say(
    pose: ArmPose, side: float, elbow: tuple[int, ...], wrist: tuple[int, ...]
) -> None:
    np.testing.assert_allclose(arm(pose, side), [elbow, wrist], atol=1e-12)


def test_knees_bend_backwards_and_feet_of_bent_legs_stay_level() -> None:
    body, pose = Skeleton(STILL), LegPose(30.0, 0.0, 50.0)
    thigh = body.joint(GROUND, (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), 0.1, turn=pose.hip(1.0))
    shin = body.joint(thigh, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.1, turn=pose.knee_turn())
    foot = body.joint(shin, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1, turn=turned(pitch_deg=pose.ankle))
    rad = np.radians
    knee = (np.sin(rad(30)), 0.0, 2.0 - np.cos(rad(30)))
    ankle = (knee[0] - np.sin(rad(20)), 0.0, knee[2] - np.cos(rad(20)))
    np.testing.assert_allclose(body.joints[shin].start, knee, atol=1e-12)
    np.testing.assert_allclose(body.joints[shin].end, ankle, atol=1e-12)
    np.testing.assert_allclose(np.subtract(body.joints[foot].end, ankle), (1.0, 0.0, 0.0), atol=1e-12)


def test_people_stand_with_the_lowest_of_them_on_the_ground() -> None:
    poses = set()
    for seed in range(16):
        rng = np.random.default_rng(seed)
        person = sample_person(rng, 24)
        bodies = [part.shape for part in person.parts if isinstance(part.shape, SoftBody)]
        lowest = min(
            float(body.mesh().vertices[:, 2].min()) / body.frame.factor + body.frame.centre[2]
            for body in bodies
        )
        assert -0.06 < lowest < 0.02
        poses.add(round(person.height, 2))
    assert len(poses) > 8


def test_poses_are_many_and_none_is_at_attention() -> None:
    assert len(STANDING) + len(LOW) >= 15
    for seed in range(20):
        pose = sample_pose(np.random.default_rng(seed), walks=seed % 2 == 0)
        assert max(arm.elbow for arm in pose.arms) > 8 or max(abs(arm.forward) for arm in pose.arms) > 20
        assert all(arm.elbow >= 4 for arm in pose.arms)
        assert all(leg.knee >= 2 for leg in pose.legs)

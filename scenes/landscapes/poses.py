"""Poses of two-legged bodies: angles of trunk, head, arms and legs, by what the body does.

Angles are degrees from standing at attention, the arms hanging.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from scenes.landscapes.skeleton import turned
from scenes.random_draws import chance, choose, uniform


@dataclass(frozen=True)
class ArmPose:
    """How an arm is held."""

    forward: float = 6.0
    """Raised forward: 90 is level, 180 up."""
    out: float = 9.0
    """Raised sideways, away from the body."""
    inward: float = 0.0
    """Turned towards the middle, once it is raised."""
    twist: float = 15.0
    """Turned about itself: at 90 the forearm bends across the body instead of forward."""
    elbow: float = 22.0

    def shoulder(self, side: float) -> Rotation:
        """The turn of the left (`side` 1) or right (-1) upper arm."""
        return (
            Rotation.from_euler("Z", -side * self.inward, degrees=True)
            * Rotation.from_euler("X", side * self.out, degrees=True)
            * Rotation.from_euler("Y", -self.forward, degrees=True)
            * Rotation.from_euler("Z", -side * self.twist, degrees=True)
        )

    def elbow_turn(self) -> Rotation:
        """The turn of the forearm."""
        return turned(pitch_deg=-self.elbow)


@dataclass(frozen=True)
class LegPose:
    """How a leg stands."""

    forward: float = 0.0
    out: float = 3.0
    knee: float = 6.0

    def hip(self, side: float) -> Rotation:
        """The turn of the left (`side` 1) or right (-1) thigh."""
        return Rotation.from_euler("X", side * self.out, degrees=True) * turned(pitch_deg=-self.forward)

    def knee_turn(self) -> Rotation:
        """The turn of the shin."""
        return turned(pitch_deg=self.knee)

    @property
    def ankle(self) -> float:
        """Pitch of a foot that stays level, as far as an ankle lets it."""
        return float(np.clip(self.forward - self.knee, -60.0, 30.0))


@dataclass(frozen=True)
class Pose:
    """What a two-legged body does; the arms and legs of either side."""

    trunk: tuple[float, float, float] = (0.0, 2.0, 0.0)
    """Roll to the right side, pitch forward, yaw to the left."""
    head: tuple[float, float, float] = (0.0, 2.0, 0.0)
    arms: tuple[ArmPose, ArmPose] = (ArmPose(), ArmPose(forward=-4.0))
    """Left, right."""
    legs: tuple[LegPose, LegPose] = (LegPose(4.0, 4.0, 9.0), LegPose(-4.0, 5.0, 3.0))
    low: bool = False
    """Whether it is down on the ground rather than on its feet."""
    holds: bool = False
    """Whether its right hand may hold something upright."""


_RELAXED = ArmPose()
_ON_HIP = ArmPose(-18.0, 42.0, 0.0, 75.0, 88.0)
_FOLDED = ArmPose(38.0, 10.0, 0.0, 72.0, 100.0)

STANDING: dict[str, Pose] = {
    "rest": Pose(trunk=(3.0, 1.0, 6.0), legs=(LegPose(9.0, 8.0, 14.0), LegPose(-3.0, 3.0, 1.0)), holds=True),
    "hands on hips": Pose(arms=(_ON_HIP, _ON_HIP), legs=(LegPose(3.0, 9.0, 3.0), LegPose(-3.0, 9.0, 3.0))),
    "hand on hip": Pose(trunk=(5.0, 0.0, 8.0), arms=(_ON_HIP, _RELAXED), holds=True),
    "point": Pose(
        trunk=(0.0, 6.0, 14.0), head=(0.0, 0.0, -12.0), arms=(_RELAXED, ArmPose(84.0, 12.0, -6.0, 0.0, 6.0))
    ),
    "wave": Pose(trunk=(-4.0, -2.0, 0.0), arms=(_RELAXED, ArmPose(20.0, 118.0, 0.0, -60.0, 62.0))),
    "reach up": Pose(
        trunk=(0.0, -7.0, 0.0),
        head=(0.0, -26.0, 0.0),
        arms=(ArmPose(156.0, 14.0, 0.0, 0.0, 18.0), ArmPose(140.0, 20.0, 0.0, 0.0, 30.0)),
    ),
    "reach out": Pose(
        trunk=(0.0, 17.0, 6.0),
        arms=(ArmPose(66.0, 8.0, 6.0, 15.0, 22.0), ArmPose(54.0, 10.0, 6.0, 20.0, 40.0)),
        legs=(LegPose(16.0, 3.0, 22.0), LegPose(-14.0, 4.0, 6.0)),
    ),
    "folded arms": Pose(trunk=(0.0, -3.0, 0.0), arms=(_FOLDED, replace(_FOLDED, forward=46.0))),
    "think": Pose(
        head=(6.0, 12.0, 8.0), arms=(replace(_FOLDED, elbow=85.0), ArmPose(48.0, 4.0, 22.0, 35.0, 138.0))
    ),
    "shade the eyes": Pose(
        trunk=(0.0, 3.0, 12.0),
        head=(0.0, -6.0, 10.0),
        arms=(_RELAXED, ArmPose(98.0, 22.0, 24.0, 50.0, 122.0)),
    ),
    "bow": Pose(
        trunk=(0.0, 46.0, 0.0),
        head=(0.0, 18.0, 0.0),
        arms=(ArmPose(42.0, 6.0, 6.0, 40.0, 50.0), ArmPose(40.0, 6.0, 6.0, 40.0, 55.0)),
    ),
    "lean on a staff": Pose(
        trunk=(4.0, 15.0, -6.0),
        arms=(_RELAXED, ArmPose(48.0, 12.0, 4.0, 10.0, 48.0)),
        holds=True,
        legs=(LegPose(14.0, 4.0, 20.0), LegPose(-6.0, 4.0, 6.0)),
    ),
    "lunge": Pose(
        trunk=(0.0, 16.0, -12.0),
        head=(0.0, -8.0, 8.0),
        arms=(ArmPose(58.0, 46.0, 10.0, 10.0, 58.0), ArmPose(96.0, 22.0, 0.0, 0.0, 34.0)),
        legs=(LegPose(46.0, 6.0, 52.0), LegPose(-28.0, 8.0, 12.0)),
        holds=True,
    ),
    "fend off": Pose(
        trunk=(0.0, -14.0, 16.0),
        head=(0.0, 8.0, -20.0),
        arms=(ArmPose(80.0, 24.0, 12.0, 30.0, 70.0), ArmPose(96.0, 20.0, 16.0, 30.0, 78.0)),
        legs=(LegPose(-14.0, 5.0, 30.0), LegPose(18.0, 6.0, 16.0)),
    ),
    "look back": Pose(trunk=(0.0, 3.0, 34.0), head=(0.0, 0.0, 44.0), arms=(_RELAXED, ArmPose(24.0, 14.0))),
}
"""What a body that stands may do."""
LOW: dict[str, Pose] = {
    "crouch": Pose(
        trunk=(0.0, 34.0, 0.0),
        head=(0.0, -20.0, 0.0),
        arms=(ArmPose(62.0, 8.0, 0.0, 20.0, 34.0), ArmPose(50.0, 14.0, 0.0, 20.0, 60.0)),
        legs=(LegPose(98.0, 14.0, 128.0), LegPose(84.0, 14.0, 122.0)),
        low=True,
    ),
    "kneel": Pose(
        trunk=(0.0, 10.0, 0.0),
        arms=(ArmPose(34.0, 12.0, 6.0, 30.0, 64.0), ArmPose(20.0, 10.0, 0.0, 20.0, 40.0)),
        legs=(LegPose(86.0, 8.0, 90.0), LegPose(-4.0, 4.0, 92.0)),
        low=True,
        holds=True,
    ),
    "sit": Pose(
        trunk=(0.0, -14.0, 0.0),
        arms=(ArmPose(-30.0, 22.0, 0.0, 0.0, 10.0), ArmPose(56.0, 10.0, 6.0, 20.0, 30.0)),
        legs=(LegPose(124.0, 8.0, 100.0), LegPose(104.0, 14.0, 58.0)),
        low=True,
    ),
}
"""What a body may do on the ground."""
_WALK = Pose(
    trunk=(0.0, 5.0, 0.0),
    arms=(ArmPose(2.0, 7.0, 0.0, 10.0, 30.0), ArmPose(2.0, 7.0, 0.0, 10.0, 30.0)),
    legs=(LegPose(2.0, 1.0, 20.0), LegPose(2.0, 1.0, 20.0)),
    holds=True,
)
_RUN = Pose(
    trunk=(0.0, 15.0, 0.0),
    arms=(ArmPose(4.0, 9.0, 0.0, 14.0, 86.0), ArmPose(4.0, 9.0, 0.0, 14.0, 86.0)),
    legs=(LegPose(10.0, 1.0, 40.0), LegPose(10.0, 1.0, 40.0)),
)


def sample_pose(rng: np.random.Generator, *, walks: bool, low_share: float = 0.16) -> Pose:
    """A random pose, its angles a little off; mirrored one time in two, the head turned anywhere."""
    if walks:
        pose = _RUN if chance(rng, 0.2) else _WALK
    else:
        poses = LOW if chance(rng, low_share) else STANDING
        pose = poses[choose(rng, sorted(poses))]
    if not pose.holds and chance(rng, 0.5):
        pose = _mirrored(pose)
    turn = np.array(pose.head) + rng.normal(0.0, (6.0, 8.0, 24.0))
    roll, pitch, yaw = (float(value) for value in np.clip(turn, (-22, -34, -62), (22, 38, 62)))
    return replace(
        pose,
        trunk=_about(rng, pose.trunk, (3.0, 4.0, 9.0)),
        head=(roll, pitch, yaw),
        arms=(_arm_about(rng, pose.arms[0]), _arm_about(rng, pose.arms[1])),
        legs=(_leg_about(rng, pose.legs[0]), _leg_about(rng, pose.legs[1])),
    )


def _about(
    rng: np.random.Generator, angles: tuple[float, float, float], spread: tuple[float, float, float]
) -> tuple[float, float, float]:
    one, two, three = (angle + float(rng.normal(0.0, by)) for angle, by in zip(angles, spread, strict=True))
    return one, two, three


def _arm_about(rng: np.random.Generator, arm: ArmPose) -> ArmPose:
    return ArmPose(
        arm.forward + float(rng.normal(0.0, 8.0)),
        max(arm.out + float(rng.normal(0.0, 5.0)), 4.0),
        arm.inward,
        arm.twist + float(rng.normal(0.0, 8.0)),
        max(arm.elbow + float(rng.normal(0.0, 9.0)), 4.0),
    )


def _leg_about(rng: np.random.Generator, leg: LegPose) -> LegPose:
    return LegPose(
        leg.forward + float(rng.normal(0.0, 2.5)),
        leg.out + uniform(rng, 0.0, 3.0),
        max(leg.knee + float(rng.normal(0.0, 3.0)), 2.0),
    )


def _mirrored(pose: Pose) -> Pose:
    (roll, pitch, yaw), (head_roll, head_pitch, head_yaw) = pose.trunk, pose.head
    return replace(
        pose,
        trunk=(-roll, pitch, -yaw),
        head=(-head_roll, head_pitch, -head_yaw),
        arms=pose.arms[::-1],
        legs=pose.legs[::-1],
    )

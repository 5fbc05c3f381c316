"""Bodies under construction: joints, the flesh about them, and the pose that both are in.

A body is described standing at attention: it faces +x, its left is +y, its feet are at z = 0. Each joint may be
turned; what hangs on it turns with it. So a pose is geometry, not motion: meshes are built in it, and motions are
about it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.motion.deformations.articulated import Joint
from scenes.motion.trajectories import vector
from scenes.random_draws import chance, uniform
from scenes.shapes.nature.soft_bodies import Limb
from scenes.spec import Vector

STRAIGHT = Rotation.identity()
"""The turn of a joint that is as it was described."""
GROUND = -1
"""The parent of a root, and the carrier of what no joint carries."""


@dataclass(frozen=True)
class Gait:
    """How a character moves about its pose: amplitudes of its joints in degrees, and the period."""

    walks: bool
    leg_deg: float
    arm_deg: float
    head_deg: float
    sway_deg: float
    period_frames: float
    phase: float
    """Where in its period the motion is at frame 0, 0..1."""


def sample_gait(rng: np.random.Generator, walking_share: float = 0.5) -> Gait:
    """Draw a random gait; a share of them walk."""
    walks = chance(rng, walking_share)
    return Gait(
        walks=walks,
        leg_deg=uniform(rng, 17.0, 30.0) if walks else uniform(rng, 0.0, 1.5),
        arm_deg=uniform(rng, 14.0, 34.0) if walks else uniform(rng, 3.0, 12.0),
        head_deg=uniform(rng, 3.0, 14.0),
        sway_deg=uniform(rng, 1.0, 4.0),
        period_frames=uniform(rng, 14.0, 36.0),
        phase=uniform(rng, 0.0, 1.0),
    )


class Skeleton:
    """A body under construction: its joints, and its flesh by groups that each become one mesh.

    All positions are given as the body stands at attention, and are kept as it is posed. Lengths are body units.
    """

    def __init__(self, gait: Gait) -> None:
        self.gait = gait
        self.joints: list[Joint] = []
        self.limbs: dict[str, list[Limb]] = {}
        self._moves: list[NDArray[np.float64]] = []
        """(4, 4) of each joint, from attention to the pose."""

    def joint(
        self,
        parent: int,
        start: Vector,
        end: Vector,
        radius: float,
        axis: Vector = (0.0, 1.0, 0.0),
        swing_deg: float = 0.0,
        phase: float = 0.0,
        turn: Rotation = STRAIGHT,
    ) -> int:
        """Add a joint, turned about its start, that swings about `axis` (`Joint`); returns its index."""
        base = self.move(parent)
        local = np.eye(4)
        local[:3, :3] = turn.as_matrix()
        local[:3, 3] = np.array(start) - local[:3, :3] @ start
        move = base @ local
        self._moves.append(move)
        self.joints.append(
            Joint(
                parent,
                self.posed(parent, start),
                self.posed(len(self.joints), end),
                radius,
                vector(move[:3, :3] @ axis),
                swing_deg,
                1,
                (phase + self.gait.phase) % 1.0,
            )
        )
        return len(self.joints) - 1

    def move(self, carrier: int) -> NDArray[np.float64]:
        """(4, 4) from attention to the pose of what a joint carries."""
        return np.eye(4) if carrier == GROUND else self._moves[carrier]

    def posed(self, carrier: int, point: Vector) -> Vector:
        """Where the pose puts a point that a joint carries."""
        move = self.move(carrier)
        return vector(move[:3, :3] @ point + move[:3, 3])

    def aimed(self, carrier: int, direction: Vector) -> Vector:
        """Where a direction points in the pose."""
        return vector(self.move(carrier)[:3, :3] @ direction)

    def flesh(
        self, group: str, carrier: int, start: Vector, end: Vector, radius: float, end_radius: float
    ) -> None:
        """Add a capsule of flesh that a joint carries to the group of limbs that becomes one mesh."""
        limb = Limb(self.posed(carrier, start), self.posed(carrier, end), radius, end_radius)
        self.limbs.setdefault(group, []).append(limb)

    def bone(
        self,
        group: str,
        parent: int,
        start: Vector,
        end: Vector,
        radii: tuple[float, float],
        axis: Vector = (0.0, 1.0, 0.0),
        swing_deg: float = 0.0,
        phase: float = 0.0,
        turn: Rotation = STRAIGHT,
    ) -> int:
        """Add a joint with its flesh, of the given radii at both ends; returns its index."""
        index = self.joint(parent, start, end, sum(radii) / 2, axis, swing_deg, phase, turn)
        self.flesh(group, index, start, end, *radii)
        return index

    def stand(self, soles: Iterable[Limb], feet: Sequence[int]) -> None:
        """Lower or raise the body until the lowest of the soles is on the ground, its feet about the origin."""
        lowest = min(min(sole.start[2] - sole.start_radius, sole.end[2] - sole.end_radius) for sole in soles)
        ends = np.array([self.joints[foot].end for foot in feet]) if feet else np.zeros((1, 3))
        shift = np.array((*-ends[:, :2].mean(axis=0), -lowest))
        lift = np.eye(4)
        lift[:3, 3] = shift
        self._moves = [lift @ move for move in self._moves]
        self.joints = [
            replace(joint, start=_shifted(joint.start, shift), end=_shifted(joint.end, shift))
            for joint in self.joints
        ]
        self.limbs = {
            group: [
                replace(limb, start=_shifted(limb.start, shift), end=_shifted(limb.end, shift))
                for limb in limbs
            ]
            for group, limbs in self.limbs.items()
        }


def _shifted(point: Vector, shift: NDArray[np.float64]) -> Vector:
    return vector(np.array(point) + shift)


def turned(roll_deg: float = 0.0, pitch_deg: float = 0.0, yaw_deg: float = 0.0) -> Rotation:
    """A turn by a yaw to the left, of a pitch forward and down, of a roll to the right side, in degrees."""
    return Rotation.from_euler("ZYX", (yaw_deg, pitch_deg, roll_deg), degrees=True)

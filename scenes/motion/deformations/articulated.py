"""Articulated bodies: a tree of joints that swing, and a skin that follows them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.geometry.implicit_surfaces import capsule_distances
from scenes.spec import Deformation, Vector


@dataclass(frozen=True)
class Joint:
    """One bone of a body at rest, in body coordinates, and how it swings about its start."""

    parent: int
    """Index of its parent, smaller than its own; -1 for the root."""
    start: Vector
    end: Vector
    radius: float
    """Thickness of the flesh about it, which decides how much of the skin follows it."""
    axis: Vector = (0.0, 1.0, 0.0)
    """Unit vector about which it swings."""
    amplitude_deg: float = 0.0
    cycles: int = 1
    """Swings in one period of the body."""
    phase: float = 0.0
    """Where in its swing the joint is at frame 0, 0..1."""


@dataclass(frozen=True)
class Articulated(Deformation):
    """Linear blend skinning (Magnenat-Thalmann et al. 1988) of a body whose joints swing periodically.

    Each point of the skin follows the joints by how near they are at rest. The body rises and sinks over its
    legs, so that the lowest foot is always at the height it has at rest.
    """

    joints: tuple[Joint, ...]
    period_frames: float
    centre: Vector = (0.0, 0.0, 0.0)
    """Body coordinates are mesh coordinates times `unit`, plus this."""
    unit: float = 1.0
    feet: tuple[int, ...] = ()
    """Joints whose ends stand on the ground; none for what hangs, swims or flies."""
    softness: float = 0.03
    """Width of the zone in which the skin passes from one joint to the next, in body coordinates."""
    carried_by: int = -1
    """Index of the one joint that the whole mesh follows rigidly (eyes, horns, tools); -1 for a skin."""

    def deformed(self, vertices: NDArray[np.float64], time_frames: float) -> NDArray[np.float64]:
        rest = vertices * self.unit + self.centre
        moves = self.poses(time_frames)
        if self.carried_by >= 0:
            moved = rest @ moves[self.carried_by, :3, :3].T + moves[self.carried_by, :3, 3]
        else:
            weights = self._weights(rest)
            blended = np.tensordot(weights, moves[:, :3], axes=1)
            moved = np.einsum("vij,vj->vi", blended[:, :, :3], rest) + blended[:, :, 3]
        placed: NDArray[np.float64] = (moved - self.centre) / self.unit
        return placed

    def poses(self, time_frames: float) -> NDArray[np.float64]:
        """(J, 4, 4) motion of every joint from rest, in body coordinates."""
        moves = np.empty((len(self.joints), 4, 4))
        for index, joint in enumerate(self.joints):
            cycle = joint.cycles * time_frames / self.period_frames + joint.phase
            swing = math.radians(joint.amplitude_deg) * math.sin(2 * math.pi * cycle)
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(swing * np.array(joint.axis)).as_matrix()
            turn[:3, 3] = np.array(joint.start) - turn[:3, :3] @ joint.start
            moves[index] = turn if joint.parent < 0 else moves[joint.parent] @ turn
        if self.feet:
            moves[:, 2, 3] -= self._lift(moves)
        return moves

    def _lift(self, moves: NDArray[np.float64]) -> float:
        """How high the lowest foot is above its rest: a smooth minimum, because two feet take turns."""
        ends = np.array([self.joints[foot].end for foot in self.feet])
        now = np.einsum("fij,fj->fi", moves[list(self.feet), :3, :3], ends) + moves[list(self.feet), :3, 3]
        rise = now[:, 2] - ends[:, 2]
        sharpness = 150.0
        lowest = rise.min()
        return float(lowest - np.log(np.exp((lowest - rise) * sharpness).mean()) / sharpness)

    def _weights(self, rest: NDArray[np.float64]) -> NDArray[np.float64]:
        """(V, J) skinning weights of the joints for each vertex; every row sums to 1."""
        start = np.array([joint.start for joint in self.joints])
        end = np.array([joint.end for joint in self.joints])
        radius = np.array([joint.radius for joint in self.joints])
        distance = capsule_distances(rest, start, end, radius, radius)
        nearness = np.exp((distance.min(axis=1, keepdims=True) - distance) / self.softness)
        weights: NDArray[np.float64] = nearness / nearness.sum(axis=1, keepdims=True)
        return weights

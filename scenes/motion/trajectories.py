"""Random smooth motions."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.spec import Quaternion, Trajectory, Vector

KEY_SPACING_FRAMES = 8.0
"""Largest distance in time between key poses: the time scale on which random motion changes direction."""


def vector(values: NDArray[np.float64]) -> Vector:
    """A plain tuple of three numbers."""
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def quaternion(rotation: Rotation) -> Quaternion:
    """(w, x, y, z) of a single rotation."""
    x, y, z, w = (float(value) for value in rotation.as_quat())
    return (w, x, y, z)


def key_times(frames: int) -> NDArray[np.float64]:
    """(K,) key times from one frame before the first to one after the last, so that no frame is at an end."""
    count = 2 + math.floor((frames + 1) / KEY_SPACING_FRAMES)
    return np.linspace(-1.0, float(frames), count)


def wander(
    rng: np.random.Generator,
    frames: int,
    position_m: NDArray[np.float64],
    rotation: Rotation,
    *,
    speed_m: float,
    turn_deg: float,
    reach_m: float = math.inf,
    reach_deg: float = math.inf,
) -> Trajectory:
    """A smooth random trajectory about a pose, moving and turning by about `speed_m` and `turn_deg` a frame.

    `position_m` (3,) and `rotation` are the pose. Key poses stay within `reach_m` and `reach_deg` of it, however
    long the scene is.
    """
    times = key_times(frames)
    spacing = float(times[1] - times[0])
    step_m = min(speed_m * spacing / 2, reach_m)
    step_deg = min(turn_deg * spacing / 2, reach_deg)
    # Uniform in a ball: two such points are about 1.03 of its radius apart.
    positions = position_m + step_m * _in_ball(rng, len(times))
    turns = Rotation.from_rotvec(np.radians(step_deg) * _in_ball(rng, len(times)))
    return Trajectory(
        times_frames=tuple(float(time) for time in times),
        positions_m=tuple(vector(position) for position in positions),
        rotations=tuple(quaternion(rotation * turn) for turn in turns),
    )


def _in_ball(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """(count, 3) points uniform in the unit ball."""
    points = rng.normal(size=(count, 3))
    radius = rng.uniform(0.0, 1.0, (count, 1)) ** (1 / 3)
    return points / np.linalg.norm(points, axis=1, keepdims=True) * radius


def shifted(trajectory: Trajectory, offset_m: NDArray[np.float64]) -> Trajectory:
    """The same motion, moved by a world offset (3,) in metres."""
    moved = tuple(vector(np.array(position) + offset_m) for position in trajectory.positions_m)
    return Trajectory(trajectory.times_frames, moved, trajectory.rotations)


def exposure_times(frames: int) -> NDArray[np.float64]:
    """(N,) instants at which motions are checked, from half a frame before the first frame to half after the last.

    They are half a frame apart, or farther in scenes for which that would take more than 60.
    """
    return np.linspace(-0.5, frames - 0.5, min(2 * frames + 1, 60))

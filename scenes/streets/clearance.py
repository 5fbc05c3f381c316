"""Leaving out what would come too near to the eyes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenes.motion import exposure_times
from scenes.spec import SceneObject, StereoCamera
from scenes.streets.assembly import Thing
from scenes.streets.config import DrivingConfig

_LATTICE = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 9)] * 3, indexing="ij"), -1).reshape(-1, 3)
_LATTICE = _LATTICE[np.abs(_LATTICE).max(axis=1) > 0.999]
"""Points all over the faces of the cube [-1, 1]^3."""


def keep_clear(things: Sequence[Thing], camera: StereoCamera, config: DrivingConfig) -> list[Thing]:
    """The things that keep their distance from both eyes at all times.

    A thing is judged by the bounding boxes of its objects: none may come nearer than `clearance_m`, and no
    part of one that is in view may have a disparity above `largest_disparity_share`.
    """
    watch = _Watch(camera, config)
    return [thing for thing in things if not any(watch.too_near(item) for item in thing)]


class _Watch:
    """The eyes at all instants that are looked at."""

    def __init__(self, camera: StereoCamera, config: DrivingConfig) -> None:
        self.times = exposure_times(config.frames)
        self.to_eye = np.stack([np.linalg.inv(camera.pose("left", time)) for time in self.times])
        self.right = np.array((camera.baseline_m, 0.0, 0.0))
        self.clearance_m = config.clearance_m
        self.nearest_m = camera.disparity_metres / (config.largest_disparity_share * config.width)
        # Half the field of view and a little more, as boxes are probed at points.
        self.half_x = 1.06 * config.width / 2 / camera.focal_px
        self.half_y = 1.06 * config.height / 2 / camera.focal_px
        self.far_m = max(self.nearest_m, self.clearance_m)

    def too_near(self, item: SceneObject) -> bool:
        half = _half_box(item)
        reach_m = float(np.linalg.norm(half))
        if len(item.motion.times_frames) == 1:
            to_eyes = self.to_eye @ item.motion.pose(0.0)
        else:
            to_eyes = self.to_eye @ np.stack([item.motion.pose(time) for time in self.times])
        distance = np.linalg.norm(to_eyes[:, :3, 3], axis=1)
        near = distance < reach_m + self.far_m + self.right[0]
        return any(self._near_box(pose, half) for pose in to_eyes[near])

    def _near_box(self, pose: NDArray[np.float64], half: NDArray[np.float64]) -> bool:
        """pose: from the object (unscaled) to the left eye."""
        for eye in (np.zeros(3), self.right):
            inside = np.clip(pose[:3, :3].T @ (eye - pose[:3, 3]), -half, half)
            if np.linalg.norm(pose[:3, :3] @ inside + pose[:3, 3] - eye) < self.clearance_m:
                return True
        points = (_LATTICE * half) @ pose[:3, :3].T + pose[:3, 3]
        depth = -points[:, 2]
        front = (depth > 0.0) & (depth < self.nearest_m)
        seen = (np.abs(points[:, 0] - self.right[0] / 2) < self.half_x * depth + self.right[0] / 2) & (
            np.abs(points[:, 1]) < self.half_y * depth
        )
        return bool((front & seen).any())


def _half_box(item: SceneObject) -> NDArray[np.float64]:
    vertices = item.shape.mesh().vertices
    half: NDArray[np.float64] = np.abs(vertices).max(axis=0) * item.scale_m
    return half

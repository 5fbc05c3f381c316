"""Leaving out what would come too near to the eyes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenes.motion.trajectories import exposure_times
from scenes.placement.assembly import Thing
from scenes.shapes.metric import MetricShape
from scenes.spec import SceneObject, StereoCamera
from scenes.streets.config import DrivingConfig

_LATTICE = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 9)] * 3, indexing="ij"), -1).reshape(-1, 3)
_LATTICE = _LATTICE[np.abs(_LATTICE).max(axis=1) > 0.999]
"""Points all over the faces of the cube [-1, 1]^3."""


_OUT_OF_SIGHT_M = 12.0
"""What stays this far outside both eyes' view at all times is left out: its shadow would hardly be seen."""


def keep_clear(things: Sequence[Thing], camera: StereoCamera, config: DrivingConfig) -> list[Thing]:
    """The things that may be seen and keep their distance from both eyes at all times.

    A thing is judged by the bounding boxes of its objects: none may come nearer than `clearance_m`, and no
    part of one that is in view may have a disparity above `largest_disparity_share`.
    """
    watch = _Watch(camera, config)
    return [thing for thing in things if watch.may_be_seen(thing) and not any(map(watch.too_near, thing))]


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

    def may_be_seen(self, thing: Thing) -> bool:
        return any(self._in_sight(item) for item in thing)

    def _in_sight(self, item: SceneObject) -> bool:
        key_places, half, slack = _reach(item)
        reach = float(np.linalg.norm(half)) + slack + _OUT_OF_SIGHT_M
        seen = np.einsum("tij,kj->tki", self.to_eye[:, :3, :3], key_places) + self.to_eye[:, None, :3, 3]
        outside = np.abs(seen[..., 0] - self.right[0] / 2) + self.half_x * seen[..., 2]
        # The distance from the nearer side of the view, and from the plane of the eyes.
        side = outside / np.hypot(1.0, self.half_x)
        return bool(((side < reach) & (seen[..., 2] < reach)).any())

    def too_near(self, item: SceneObject) -> bool:
        key_places, half, slack = _reach(item)
        limit = float(np.linalg.norm(half)) + self.far_m + self.right[0]
        rough = np.einsum("tij,kj->tki", self.to_eye[:, :3, :3], key_places) + self.to_eye[:, None, :3, 3]
        if np.linalg.norm(rough, axis=2).min() > limit + slack:
            return False
        still = len(item.motion.times_frames) == 1
        poses = item.motion.pose(0.0) if still else np.stack([item.motion.pose(time) for time in self.times])
        to_eyes = self.to_eye @ poses
        near = np.linalg.norm(to_eyes[:, :3, 3], axis=1) < limit
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


def _reach(item: SceneObject) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Key positions (K, 3), half the bounding box (3,), and how far from a key position it may get."""
    assert isinstance(item.shape, MetricShape)
    places = np.array(item.motion.positions_m)
    slack = float(np.linalg.norm(np.diff(places, axis=0), axis=1).max(initial=0.0))
    return places, item.shape.half_box_m, slack

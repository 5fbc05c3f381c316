"""Leaving out what would come too near to the cameras, and what they never see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenes.motion.trajectories import exposure_times
from scenes.placement.assembly import ObjectGroup
from scenes.placement.boxes import OrientedBox
from scenes.placement.view import half_view
from scenes.shapes.anchored import frame_of
from scenes.spec import SceneObject, StereoCamera

_OUT_OF_SIGHT_M = 12.0
"""What stays this far outside both views at all times is left out: its shadow would hardly be seen."""
_VIEW_MARGIN = 1.06
"""The field of view is taken a little larger than it is, because boxes are probed at points."""


def keep_clear(
    groups: Sequence[ObjectGroup], camera: StereoCamera, frames: int, *, clearance_m: float, nearest_m: float
) -> list[ObjectGroup]:
    """The things that may be seen and that keep their distance from both cameras at all times.

    A thing is judged by the bounding boxes of its objects: none may come nearer than `clearance_m`, and no
    part of one that is in view may have a depth below `nearest_m`. Deformations are not looked at.
    """
    path = _CameraPath(camera, frames, clearance_m, nearest_m)
    return [group for group in groups if path.may_see(group) and not any(map(path.is_too_near, group))]


class _CameraPath:
    """Both cameras at all instants that are looked at."""

    def __init__(self, camera: StereoCamera, frames: int, clearance_m: float, nearest_m: float) -> None:
        self.times = exposure_times(frames)
        self.to_left = np.stack([np.linalg.inv(camera.pose("left", time)) for time in self.times])
        self.baseline_m = camera.baseline_m
        self.cameras = np.array([(0.0, 0.0, 0.0), (camera.baseline_m, 0.0, 0.0)])
        self.clearance_m, self.nearest_m = clearance_m, nearest_m
        self.half_x, self.half_y = (_VIEW_MARGIN * half for half in half_view(camera))

    def may_see(self, group: ObjectGroup) -> bool:
        """Whether a thing comes into either view or near it."""
        return any(self._is_near_view(item) for item in group)

    def _is_near_view(self, item: SceneObject) -> bool:
        keys, half, slack = _extent(item)
        reach = float(np.linalg.norm(half)) + slack + _OUT_OF_SIGHT_M
        places = self._seen_from_left(keys)
        outside = np.abs(places[..., 0] - self.baseline_m / 2) + self.half_x * places[..., 2]
        # Distances from the view's nearer edge, and from the cameras' common plane.
        edge = outside / np.hypot(1.0, self.half_x)
        return bool(((edge < reach) & (places[..., 2] < reach)).any())

    def is_too_near(self, item: SceneObject) -> bool:
        """Whether an object ever comes nearer than the clearance, or in view nearer than allowed."""
        keys, half, slack = _extent(item)
        limit = float(np.linalg.norm(half)) + max(self.nearest_m, self.clearance_m) + self.baseline_m
        if np.linalg.norm(self._seen_from_left(keys), axis=2).min() > limit + slack:
            return False
        still = len(item.motion.times_frames) == 1
        poses = item.motion.pose(0.0) if still else np.stack([item.motion.pose(time) for time in self.times])
        to_left = self.to_left @ poses
        near = np.linalg.norm(to_left[:, :3, 3], axis=1) < limit
        return any(
            self._is_box_too_near(OrientedBox(pose[:3, 3], half, pose[:3, :3])) for pose in to_left[near]
        )

    def _seen_from_left(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(T, K, 3) world points (K, 3) in the left camera's coordinates at every instant."""
        turned = np.einsum("tij,kj->tki", self.to_left[:, :3, :3], points)
        return turned + self.to_left[:, None, :3, 3]

    def _is_box_too_near(self, box: OrientedBox) -> bool:
        """For a box in the left camera's coordinates."""
        if box.distance(self.cameras) < self.clearance_m:
            return True
        x, y, z = box.surface_points.T
        depth, middle = -z, self.baseline_m / 2
        front = (depth > 0.0) & (depth < self.nearest_m)
        seen = (np.abs(x - middle) < self.half_x * depth + middle) & (np.abs(y) < self.half_y * depth)
        return bool((front & seen).any())


def _extent(item: SceneObject) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Key positions (K, 3), half the bounding box (3,), and how far from a key position it may get."""
    frame = frame_of(item.shape)
    half = (frame.high - frame.low) / 2 * frame.factor * item.scale_m
    places = np.array(item.motion.positions_m)
    slack = float(np.linalg.norm(np.diff(places, axis=0), axis=1).max(initial=0.0))
    return places, half, slack

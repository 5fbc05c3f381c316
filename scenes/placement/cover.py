"""How much of a view a thing covers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenes.placement.view import View
from scenes.shapes.anchored import frame_of
from scenes.spec import SceneObject

_NEAREST_M = 0.05


def covered_share(objects: Sequence[SceneObject], view: View) -> float:
    """The share of the image that the bounding rectangle of some objects covers half way through the scene, 0..1."""
    to_left = np.linalg.inv(view.pose)
    time = (view.frames - 1) / 2
    local = np.concatenate([_corners(item, time) for item in objects]) @ to_left[:3, :3].T + to_left[:3, 3]
    depth = -local[:, 2]
    if depth.max() <= 0:
        return 0.0
    across, high = view.half_view
    near = np.maximum(depth, _NEAREST_M)
    sides = [np.clip(local[:, axis] / (near * half), -1, 1) for axis, half in ((0, across), (1, high))]
    return float(np.prod([np.ptp(side) / 2 for side in sides]))


def _corners(item: SceneObject, time_frames: float) -> NDArray[np.float64]:
    """(8, 3) world corners of an object's bounding box."""
    frame = frame_of(item.shape)
    half = (frame.high - frame.low) / 2 * frame.factor
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, 8).T
    pose = item.pose(time_frames)
    return signs * half @ pose[:3, :3].T + pose[:3, 3]

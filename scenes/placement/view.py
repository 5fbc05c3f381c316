"""Where a stereo rig's cameras are, and what they see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenes.motion.trajectories import exposure_times
from scenes.spec import StereoCamera


def half_view(camera: StereoCamera) -> tuple[float, float]:
    """Tangents of half the horizontal and of half the vertical field of view.

    They are those of the least field of view about the optical axis that holds both views.
    """
    aside = max(abs(camera.center_left_px), abs(camera.center_right_px))
    across, down = camera.width / 2 + aside, camera.height / 2 + abs(camera.center_down_px)
    return across / camera.focal_px, down / camera.focal_y_px


def camera_positions(camera: StereoCamera, frames: int) -> NDArray[np.float64]:
    """(N, 3) world positions of both cameras over the whole scene (`exposure_times`)."""
    return np.array(
        [camera.pose(view, time)[:3, 3] for time in exposure_times(frames) for view in ("left", "right")]
    )


@dataclass(frozen=True)
class View:
    """What a rig sees half way through a scene, for placing things in the image."""

    camera: StereoCamera
    frames: int

    @property
    def pose(self) -> NDArray[np.float64]:
        """(4, 4) from the left camera to the world."""
        return self.camera.pose("left", (self.frames - 1) / 2)

    @property
    def half_view(self) -> tuple[float, float]:
        """Tangents of half the horizontal and of half the vertical field of view."""
        return half_view(self.camera)

    def point(self, right: float, up: float, depth_m: float) -> NDArray[np.float64]:
        """(3,) world point at an image position and a depth.

        The frame is -1..1 both ways, seen from the middle between the cameras.
        """
        across, high = self.half_view
        local = (right * across * depth_m + self.camera.baseline_m / 2, up * high * depth_m, -depth_m)
        pose = self.pose
        world: NDArray[np.float64] = pose[:3, :3] @ local + pose[:3, 3]
        return world

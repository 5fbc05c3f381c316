"""Exact targets from geometry: disparity, forward-difference gradients, occlusion by real rays.

Pure functions of arrays. Camera frame: x right, y up, looking along -z; pixel (row i, column j) is seen
through its centre (j + 0.5, i + 0.5); the principal point is the image's middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from datagen.layout import Eye

VISIBLE, OCCLUDED, OUT_OF_FRAME = 0, 1, 2
"""Labels of an occlusion map."""


SAME_SURFACE = 1e-4
"""Share of the distance within which a hit still counts as the surface itself.

The point is rebuilt from a 32-bit depth and the rays are cast in 32 bits; two surfaces this close differ by
less than 0.02 px at the largest disparities.
"""


def disparity_from_depth(depth_m: NDArray[np.float32], disparity_metres: float) -> NDArray[np.float32]:
    """d = fx * B / Z in float64, stored as float32; 0 where depth is infinite.

    depth_m: (H, W) distance along the optical axis. disparity_metres: focal length in pixels times baseline.
    """
    return (disparity_metres / depth_m.astype(np.float64)).astype(np.float32)


def forward_differences(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, 2) forward differences [dx, dy] (METHOD: section 2 of the paper); 0 where they leave the image."""
    gradient = np.zeros((*disparity.shape, 2), np.float32)
    gradient[:, :-1, 0] = disparity[:, 1:] - disparity[:, :-1]
    gradient[:-1, :, 1] = disparity[1:] - disparity[:-1]
    return gradient


def gradient_validity(gradient: NDArray[np.float32], threshold_px: float) -> NDArray[np.bool_]:
    """(H, W) True where both differences exist and neither jumps by more than the threshold.

    The last column and row have no forward difference; a larger jump is a discontinuity, which the paper
    masks out of GradNet's loss.
    """
    valid = (np.abs(gradient) <= threshold_px).all(axis=-1)
    valid[:, -1] = False
    valid[-1, :] = False
    return valid


@dataclass(frozen=True)
class RectifiedPair:
    """The intrinsics the two eyes share."""

    width: int
    height: int
    focal_px: float
    baseline_m: float

    def rays(self) -> NDArray[np.float64]:
        """(H, W, 3) directions through the pixel centres with unit length along the optical axis."""
        x = (np.arange(self.width) + 0.5 - self.width / 2) / self.focal_px
        y = -(np.arange(self.height) + 0.5 - self.height / 2) / self.focal_px
        grid_x, grid_y = np.meshgrid(x, y)
        return np.stack([grid_x, grid_y, np.full_like(grid_x, -1.0)], axis=-1)


class OcclusionTester:
    """Answers, for every pixel of one eye, whether the other eye sees the same point."""

    def __init__(self, triangles: NDArray[np.float64], pair: RectifiedPair) -> None:
        """triangles: (T, 3, 3) corners in the left camera's frame, metres."""
        self._pair = pair
        self._rays = pair.rays()
        self._scene: EmbreeScene | None = None
        if len(triangles):
            self._scene = EmbreeScene(robust=True)
            TriangleMesh(self._scene, triangles.astype(np.float32))

    def labels(self, eye: Eye, depth_m: NDArray[np.float32]) -> NDArray[np.uint8]:
        """(H, W) VISIBLE, OCCLUDED or OUT_OF_FRAME for the pixels of `eye`.

        A point outside the other image is OUT_OF_FRAME whatever stands before it. Every surface is opaque.
        depth_m: (H, W) distance along the optical axis, inf where nothing is hit.
        """
        hidden = self._hidden(eye, depth_m)
        sign = -1.0 if eye == "left" else 1.0
        disparity = self._pair.focal_px * self._pair.baseline_m / depth_m.astype(np.float64)
        x_other = np.arange(self._pair.width) + 0.5 + sign * disparity
        outside = (x_other < 0) | (x_other > self._pair.width)
        return np.where(outside, OUT_OF_FRAME, np.where(hidden, OCCLUDED, VISIBLE)).astype(np.uint8)

    def _hidden(self, eye: Eye, depth_m: NDArray[np.float32]) -> NDArray[np.bool_]:
        if self._scene is None:
            return np.zeros(depth_m.shape, bool)
        left_eye, right_eye = np.zeros(3), np.array([self._pair.baseline_m, 0.0, 0.0])
        own, other = (left_eye, right_eye) if eye == "left" else (right_eye, left_eye)
        at_infinity = ~np.isfinite(depth_m)
        depth = np.where(at_infinity, 1.0, depth_m.astype(np.float64))
        towards = self._rays * depth[..., None]
        # A point at infinity lies in the same direction from both eyes.
        towards = np.where(at_infinity[..., None], towards, towards + own - other)
        reach = np.where(at_infinity, np.float32(1e30), np.float32(1.0 - SAME_SURFACE))
        hits = self._scene.run(
            np.broadcast_to(other, towards.shape).reshape(-1, 3).astype(np.float32),
            towards.reshape(-1, 3).astype(np.float32),
            dists=reach.reshape(-1).astype(np.float32),
            query="OCCLUDED",
        )
        return np.asarray(hits).reshape(depth_m.shape) == 0


def to_camera_frame(
    triangles: NDArray[np.float64], camera_to_world: NDArray[np.float64]
) -> NDArray[np.float64]:
    """World-space corners (T, 3, 3) in the frame of a camera with the given (4, 4) pose (a rigid motion)."""
    return (triangles - camera_to_world[:3, 3]) @ camera_to_world[:3, :3]

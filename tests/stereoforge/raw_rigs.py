"""A slanted, textured wall as two cameras with distortion see it, by formulas that share no code with the program."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

SIZE = (480, 360)
WALL = np.array([-0.25, 0.1, 1.0])
WALL_M = 2.0
"""The wall's points X have WALL @ X = WALL_M, in the left camera's frame."""
TEXELS_PER_M = 200.0
SUPERSAMPLING = 2
COARSE = 60


@dataclass(frozen=True)
class RawRig:
    """Two cameras; arrays as OpenCV has them."""

    k1: NDArray[np.float64]
    d1: NDArray[np.float64]
    k2: NDArray[np.float64]
    d2: NDArray[np.float64]
    rotation: NDArray[np.float64]
    shift: NDArray[np.float64]
    fisheye: bool = False

    def pixels(self, points: NDArray[np.float64], right: bool) -> NDArray[np.float64]:
        """Where a camera sees points (N, 3) of the left one's frame, (N, 2), with its distortion."""
        k, d = (self.k2, self.d2) if right else (self.k1, self.d1)
        if right:
            points = points @ self.rotation.T + self.shift
        x, y = (points[:, :2] / points[:, 2:]).T
        r = np.hypot(x, y)
        if self.fisheye:
            angle = np.arctan(r)
            bent = angle * (1 + d[0] * angle**2 + d[1] * angle**4 + d[2] * angle**6 + d[3] * angle**8)
            x, y = x * bent / r, y * bent / r
        else:
            k_1, k_2, p_1, p_2, k_3 = d
            radial = 1 + k_1 * r**2 + k_2 * r**4 + k_3 * r**6
            x, y = (
                x * radial + 2 * p_1 * x * y + p_2 * (r**2 + 2 * x**2),
                y * radial + p_1 * (r**2 + 2 * y**2) + 2 * p_2 * x * y,
            )
        return np.column_stack([k[0, 0] * x + k[0, 2], k[1, 1] * y + k[1, 2]])

    def picture(self, right: bool) -> NDArray[np.uint8]:
        """What a camera sees of the wall."""
        steps = [(np.arange(side * SUPERSAMPLING) + 0.5) / SUPERSAMPLING - 0.5 for side in SIZE]
        coarse = [np.linspace(-1, side, COARSE) for side in SIZE]
        wanted = np.stack(np.meshgrid(*coarse), axis=-1).reshape(-1, 2)
        # Between the coarse pixels directions are smooth enough for splines.
        splines = [
            RectBivariateSpline(coarse[1], coarse[0], values.reshape(COARSE, COARSE))
            for values in self._rays(wanted, right)[:, :2].T
        ]
        rays = np.column_stack(
            [
                *(spline(steps[1], steps[0]).ravel() for spline in splines),
                np.ones(SIZE[0] * SIZE[1] * SUPERSAMPLING**2),
            ]
        )
        origin = np.zeros(3)
        if right:
            rays, origin = rays @ self.rotation, -self.rotation.T @ self.shift
        hits = origin + rays * ((WALL_M - WALL @ origin) / (rays @ WALL))[:, None]
        texture = wall_texture()
        x, y = (
            (hits[:, axis] * TEXELS_PER_M + texture.shape[1 - axis] / 2)
            .reshape(steps[1].size, steps[0].size)
            .astype(np.float32)
            for axis in (0, 1)
        )
        fine = cv2.remap(texture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        return cv2.resize(fine, SIZE, interpolation=cv2.INTER_AREA)

    def _rays(self, wanted: NDArray[np.float64], right: bool) -> NDArray[np.float64]:
        """(N, 3) directions that a camera sees at pixels (N, 2), by Newton's method on `pixels`."""
        camera = RawRig(*(self.k2, self.d2) * 2, np.eye(3), np.zeros(3), self.fisheye) if right else self
        k = camera.k1
        rays = np.column_stack([(wanted - k[:2, 2]) / k[[0, 1], [0, 1]], np.ones(len(wanted))])
        small = 1e-5
        for _ in range(8):
            here = camera.pixels(rays, right=False)
            along_x = (camera.pixels(rays + np.array([small, 0, 0]), right=False) - here) / small
            along_y = (camera.pixels(rays + np.array([0, small, 0]), right=False) - here) / small
            step = np.linalg.solve(np.stack([along_x, along_y], axis=2), (wanted - here)[..., None])
            rays[:, :2] += step[..., 0]
        assert np.abs(camera.pixels(rays, right=False) - wanted).max() < 1e-3
        return rays


@cache
def wall_texture() -> NDArray[np.uint8]:
    """(H, W, 3) blots of many sizes."""
    rng = np.random.default_rng(5)
    height, width = 1200, 1600
    total = np.zeros((height, width, 3), np.float32)
    for cell in (6, 15, 50, 150):
        blots = rng.random((height // cell, width // cell, 3), np.float32)
        total += cv2.resize(blots, (width, height), interpolation=cv2.INTER_CUBIC) - 0.5
    return np.clip(128 + 75 * total, 0, 255).astype(np.uint8)


def brown_rig() -> RawRig:
    """Common lenses with clear barrel distortion, turned against one another by up to 1.7 degrees."""
    turn, _ = cv2.Rodrigues(np.array([0.02, -0.03, 0.025]))
    return RawRig(
        np.array([[390.0, 0, 247], [0, 391, 176], [0, 0, 1]]),
        np.array([-0.28, 0.09, 0.001, -0.0008, -0.01]),
        np.array([[394.0, 0, 236], [0, 393, 184], [0, 0, 1]]),
        np.array([-0.27, 0.08, -0.001, 0.0012, -0.008]),
        turn,
        np.array([-0.12, 0.003, -0.004]),
    )


def fisheye_rig() -> RawRig:
    """Lenses of 100 degrees across."""
    turn, _ = cv2.Rodrigues(np.array([-0.015, 0.02, -0.02]))
    return RawRig(
        np.array([[260.0, 0, 246], [0, 261, 177], [0, 0, 1]]),
        np.array([-0.012, 0.004, -0.002, 0.0004]),
        np.array([[262.0, 0, 237], [0, 261, 183], [0, 0, 1]]),
        np.array([-0.010, 0.003, -0.002, 0.0005]),
        turn,
        np.array([-0.12, -0.002, 0.003]),
        fisheye=True,
    )

"""Rain in the final pass: the streaks of falling drops.

Drops hang in the air before the rig, so that a drop's streak is at its own disparity in both views. Ground truth is of
what is behind them. How streaks look follows Garg and Nayar, "Vision and rain" (IJCV 2007): they show the light of a
wide part of the scene, are brighter than most of what is behind them, and let most of that through.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import View
from scenes.placement.view import half_view
from scenes.spec import Rain, StereoCamera

NEAREST_M, FARTHEST_M = 0.7, 14.0
"""Depths of the drops: farther ones blur into haze, nearer ones fall on the lens's hood."""
MOST_DROPS = 5000
_STREAM = 7
"""Keeps the drops' draws apart from the sensor's noise, which has the same seed."""
_SHIFT = 4
"""Streaks end at sixteenths of a pixel."""


def with_streaks(
    radiance: NDArray[np.float32],
    rain: Rain,
    camera: StereoCamera,
    disparity: NDArray[np.float64],
    view: View,
    frame: int,
    seed: int,
) -> NDArray[np.float32]:
    """(H, W, 3) linear RGB of a view, with the drops of an instant before it.

    Args:
        radiance: (H, W, 3) linear RGB of the view without rain.
        rain: The drops.
        camera: The rig.
        disparity: (H, W) px of the view: what is nearer than a drop hides it.
        view: Which one it is. Both views of a frame have the same drops.
        frame: The frame's number from 0.
        seed: That of the scene.
    """
    hidden = streaks(rain, camera, disparity, view, frame, seed)
    # A drop gathers light from all around: mostly from the sky and the lamps.
    bright = radiance.reshape(-1, 3)[radiance.mean(axis=2).ravel() > radiance.mean()]
    light = bright.mean(axis=0, dtype=np.float32) if len(bright) else np.zeros(3, np.float32)
    veiled: NDArray[np.float32] = radiance + hidden[..., None] * (light - radiance)
    return veiled


def streaks(
    rain: Rain, camera: StereoCamera, disparity: NDArray[np.float64], view: View, frame: int, seed: int
) -> NDArray[np.float32]:
    """(H, W) share of the light from behind that drops hide, 0..1."""
    rng = np.random.default_rng((seed, frame, _STREAM))
    places = _drops(rng, rain, camera)
    turn = camera.pose("left", float(frame))[:3, :3]
    half_fall = turn.T @ np.array(rain.streak_m) / 2
    ends = np.stack([places - half_fall, places + half_fall], 1)
    ends[..., 0] -= camera.baseline_m * (view == "right")
    depth = np.maximum(-ends[..., 2], 0.1)
    center_x, center_y = camera.principal_point(view)
    x = center_x + camera.focal_px * ends[..., 0] / depth
    y = center_y - camera.focal_y_px * ends[..., 1] / depth
    middle = -places[:, 2]
    width_px = rain.diameter_m * camera.focal_px / middle
    level = np.rint(255 * rain.opacity * np.minimum(width_px, 1.0)).astype(int)
    nearest_px = camera.disparity_metres / middle + camera.disparity_at_infinity
    height, width = disparity.shape
    row, column = np.floor(y.mean(axis=1)).astype(int), np.floor(x.mean(axis=1)).astype(int)
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    free = inside.copy()
    free[inside] = nearest_px[inside] > disparity[row[inside], column[inside]]
    picture = np.zeros((height, width), np.uint8)
    # OpenCV counts from the first pixel's centre.
    points = np.rint((np.stack([x, y], -1) - 0.5) * (1 << _SHIFT)).astype(int)
    for k in np.flatnonzero(free & (level > 0)):
        start, end = points[k].tolist()
        thickness = max(1, round(float(width_px[k])))
        cv2.line(picture, start, end, int(level[k]), thickness, cv2.LINE_AA, _SHIFT)
    return picture.astype(np.float32) / np.float32(255)


def _drops(rng: np.random.Generator, rain: Rain, camera: StereoCamera) -> NDArray[np.float64]:
    """(N, 3) drops in the left camera's frame, evenly in the volume that the rig sees, the farthest first."""
    across, high = half_view(camera)
    # Both views and what falls into them from above.
    volume = 4 * across * high * (FARTHEST_M**3 - NEAREST_M**3) / 3
    count = min(rng.poisson(rain.drops_per_m3 * volume), MOST_DROPS)
    depth = np.cbrt(rng.uniform(NEAREST_M**3, FARTHEST_M**3, count))
    depth = np.sort(depth)[::-1]
    x = rng.uniform(-1.1, 1.1, count) * across * depth + camera.baseline_m / 2
    return np.stack([x, rng.uniform(-1.1, 1.1, count) * high * depth, -depth], -1)

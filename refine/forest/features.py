"""The forest's twelve features of a pixel, from disparity, left-right consistency, image and position."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from refine.baselines.wmf import weighted_median
from stereoforge_kit.matching import fill_nearest

Map = NDArray[np.float32]

RADII_PX = (2, 3, 4)
"""Of the windows; the paper does not give them, and these make twelve features (ours)."""
LEFT_BORDER_CAP_PX = 160
"""Distances to the left border count up to here, beyond which every disparity of interest has its match inside."""
BORDER_CAP_PX = 5
"""Distances to the nearest border count up to here."""
DISPARITY_EDGE_PX = 1.0
"""Neighbouring disparities further apart than this are an edge (ours; published code runs Canny on the map)."""
CANNY = (50, 150)
"""Thresholds of Canny's detector on the grey image (OpenCV's units; ours)."""

FEATURES = (
    "left_right_difference",
    *(f"variance_{2 * r + 1}" for r in RADII_PX),
    *(f"median_deviation_{2 * r + 1}" for r in RADII_PX),
    "disparity_edge_distance",
    "image_gradient",
    "image_edge_distance",
    "left_border_distance",
    "border_distance",
)
"""Names of the features, in order."""


def confidence_features(disparity: Map, consistency: Map, image: NDArray[np.uint8]) -> Map:
    """The features of every pixel.

    Args:
        disparity: (H, W) pixels; NaN counts as the nearest known value.
        consistency: (H, W), negative where there is nothing to compare with (`matching.left_right_consistency`).
        image: (H, W, 3).

    Returns:
        (H, W, 12) in the order of `FEATURES`, finite.
    """
    filled = np.nan_to_num(fill_nearest(disparity), nan=0.0).astype(np.float32)
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    height, width = filled.shape
    y, x = np.mgrid[:height, :width].astype(np.float32)
    border = np.minimum(np.minimum(x, width - 1 - x), np.minimum(y, height - 1 - y))
    maps = [
        consistency,
        *(_variance(filled, radius) for radius in RADII_PX),
        # With equal weights the weighted median is the median.
        *(np.abs(weighted_median(filled, image, radius, 1e9) - filled) for radius in RADII_PX),
        _distance_to(_jumps(filled)),
        np.hypot(*(cv2.Sobel(grey, cv2.CV_32F, dx, 1 - dx, scale=1 / 8) for dx in (1, 0))),
        _distance_to(cv2.Canny(grey, *CANNY) > 0),
        np.minimum(x, LEFT_BORDER_CAP_PX),
        np.minimum(border, BORDER_CAP_PX),
    ]
    return np.stack(maps, axis=2, dtype=np.float32)


def _variance(values: Map, radius: int) -> Map:
    """Variance in the window, about the image's mean so that little is lost to rounding."""
    centred = values.astype(np.float64) - values.mean()
    size = (2 * radius + 1, 2 * radius + 1)
    mean, squares = (cv2.blur(m, size, borderType=cv2.BORDER_REFLECT) for m in (centred, centred**2))
    return np.maximum(squares - mean**2, 0).astype(np.float32)


def _jumps(values: Map) -> NDArray[np.bool_]:
    """Pixels at either side of a jump."""
    edges = np.zeros(values.shape, bool)
    across = np.abs(np.diff(values, axis=1)) > DISPARITY_EDGE_PX
    down = np.abs(np.diff(values, axis=0)) > DISPARITY_EDGE_PX
    edges[:, 1:] |= across
    edges[:, :-1] |= across
    edges[1:] |= down
    edges[:-1] |= down
    return edges


def _distance_to(edges: NDArray[np.bool_]) -> Map:
    """Euclidean distance to the nearest edge, at most the image's diagonal."""
    diagonal = float(np.hypot(edges.shape[0], edges.shape[1]))
    if not edges.any():
        return np.full(edges.shape, diagonal, np.float32)
    distance = cv2.distanceTransform((~edges).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.minimum(distance, diagonal).astype(np.float32)

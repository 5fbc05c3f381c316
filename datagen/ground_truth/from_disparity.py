"""Targets that a data set does not have, derived from its disparity maps.

They are less exact than those of `datagen.ground_truth.raycast`, which knows the geometry: pixels along silhouettes
may be wrong.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import View
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME, VISIBLE
from datagen.ground_truth.labels import forward_differences, gradient_validity

NEARER_PX = 1.0
"""A surface occludes a point if its disparity is greater by more than this, the usual margin."""
GRADIENT_THRESHOLD_PX = 1.0
"""Larger forward differences are discontinuities, as in the paper (px)."""


def derive_gradient(disparity: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Forward differences of an (H, W) disparity map in px.

    Returns:
        The differences (H, W, 2) [dx, dy], 0 next to a missing disparity, and a mask (H, W) that is True where both
        exist and neither is a discontinuity.
    """
    gradient = forward_differences(disparity)
    valid = gradient_validity(gradient, GRADIENT_THRESHOLD_PX)  # NaN compares false
    return np.nan_to_num(gradient, nan=0.0), valid


def derive_occlusion(
    view: View, disparity: NDArray[np.float32], other: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Occlusion labels (H, W) of one view from the disparities of both.

    A point falls between two pixels of the other view. It is occluded where both are nearer by more than `NEARER_PX`;
    one alone may be the edge of a neighbour. Pixels without disparity count as visible.

    Args:
        view: The view that is labelled.
        disparity: (H, W) px of that view, NaN where missing.
        other: (H, W) px of the other view.
    """
    x = _position_in_other(view, disparity)
    width = disparity.shape[1]
    columns = np.clip(np.nan_to_num(x) - 0.5, 0, width - 1)
    rows = np.arange(len(disparity))[:, None]
    nearer = [
        other[rows, rounded(columns).astype(np.int64)] > disparity + NEARER_PX
        for rounded in (np.floor, np.ceil)
    ]
    labels = np.where(nearer[0] & nearer[1], OCCLUDED, VISIBLE)
    return np.where((x < 0) | (x > width), OUT_OF_FRAME, labels).astype(np.uint8)


def occlusion_from_mask(
    disparity_left: NDArray[np.float32], not_visible: NDArray[np.bool_]
) -> NDArray[np.uint8]:
    """Occlusion labels (H, W) of the left view from a mask that is True where the right view does not show the point.

    Such a mask does not tell occluded from out of frame; the disparity (H, W) in px does.
    """
    outside = _position_in_other("left", disparity_left) < 0
    return np.where(outside, OUT_OF_FRAME, np.where(not_visible, OCCLUDED, VISIBLE)).astype(np.uint8)


def _position_in_other(view: View, disparity: NDArray[np.float32]) -> NDArray[np.float64]:
    sign = -1.0 if view == "left" else 1.0
    return np.arange(disparity.shape[1]) + 0.5 + sign * disparity.astype(np.float64)

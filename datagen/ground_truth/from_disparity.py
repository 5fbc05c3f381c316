"""Targets that a data set does not ship, worked out from the disparities it has.

Less exact than `datagen.ground_truth.labels`, which sees the geometry: what follows from two disparity maps is right
up to the pixels along silhouettes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import View
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME, VISIBLE
from datagen.ground_truth.labels import forward_differences, gradient_validity

NEARER_PX = 1.0
"""What lies this much nearer in the other view hides the point; the field's usual margin."""
GRADIENT_THRESHOLD_PX = 1.0
"""Larger forward differences are discontinuities, as in the paper."""


def derive_gradient(disparity: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Forward differences (H, W, 2) [dx, dy] and where they exist and are no discontinuity (H, W).

    A difference with a missing disparity is 0 and not valid.
    """
    gradient = forward_differences(disparity)
    valid = gradient_validity(gradient, GRADIENT_THRESHOLD_PX)  # NaN compares false
    return np.nan_to_num(gradient, nan=0.0), valid


def derive_occlusion(
    view: View, disparity: NDArray[np.float32], other: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """(H, W) VISIBLE, OCCLUDED or OUT_OF_FRAME for the pixels of `view`, from both views' disparities.

    A point is occluded where both pixels it falls between in the other view are nearer by more than `NEARER_PX`
    (one alone may be the edge of a neighbour). Pixels without disparity count as visible.
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
    """Labels of the left view from a mask that is True where the right one does not show the point.

    Such masks do not tell occluded from out of the frame; the disparity does.
    """
    outside = _position_in_other("left", disparity_left) < 0
    return np.where(outside, OUT_OF_FRAME, np.where(not_visible, OCCLUDED, VISIBLE)).astype(np.uint8)


def _position_in_other(view: View, disparity: NDArray[np.float32]) -> NDArray[np.float64]:
    sign = -1.0 if view == "left" else 1.0
    return np.arange(disparity.shape[1]) + 0.5 + sign * disparity.astype(np.float64)

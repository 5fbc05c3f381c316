"""Left-right consistency of disparity maps that may have holes (eq. 1 of Cheng, He, Zhang 2018)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stereoforge_kit.errors import InputError

INCONSISTENT = -1.0
"""Value where the matching column is outside the image, or either view has no disparity."""


def left_right_consistency(
    disparity_left: NDArray[np.float32], disparity_right: NDArray[np.float32]
) -> NDArray[np.float32]:
    """|d_l(i, j) - d_r(i, j - d_l(i, j))|, d_r read at the nearest column.

    Without holes the same map as `training.networks.left_right_consistency` of tensors.

    Args:
        disparity_left, disparity_right: (H, W) in pixels, NaN where there is none.

    Returns:
        (H, W) in pixels, `INCONSISTENT` where there is nothing to compare with.

    Raises:
        ValueError: If the maps differ in shape.
    """
    if disparity_left.shape != disparity_right.shape or disparity_left.ndim != 2:
        raise InputError(
            f"both disparities must be (H, W) and alike, got {disparity_left.shape} and {disparity_right.shape}"
        )
    width = disparity_left.shape[1]
    match = np.floor(np.arange(width, dtype=np.float32) - disparity_left + np.float32(0.5))
    inside = (match >= 0) & (match < width)
    columns = np.where(inside, match, 0).astype(np.intp)
    difference = np.abs(disparity_left - np.take_along_axis(disparity_right, columns, axis=1))
    return np.where(inside & np.isfinite(difference), difference, INCONSISTENT).astype(np.float32)

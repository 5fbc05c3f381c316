"""Fill pixels without a disparity from their surroundings."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

Real = TypeVar("Real", np.float32, np.float64)


def fill_nearest(disparity: NDArray[Real]) -> NDArray[Real]:
    """The (H, W) map with every NaN replaced by the nearest known value; all NaN stays all NaN."""
    unknown = np.isnan(disparity)
    if not unknown.any():
        return disparity
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    filled: NDArray[Real] = disparity[tuple(nearest)]
    return filled


def fill_background(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """The (H, W) map with every NaN replaced by the smaller of the next known values of its row to either side.

    What the KITTI stereo benchmark does before it compares: a pixel without a match is most often occluded in the
    other view, and what is occluded lies behind. Rows without any value take the nearest of other rows.
    """
    unknown = np.isnan(disparity)
    if not unknown.any():
        return disparity
    height, width = disparity.shape
    columns = np.broadcast_to(np.arange(width), (height, width))
    before = np.maximum.accumulate(np.where(unknown, -1, columns), axis=1)
    after = np.minimum.accumulate(np.where(unknown, width, columns)[:, ::-1], axis=1)[:, ::-1]
    rows = np.arange(height)[:, None]
    left = np.where(before >= 0, disparity[rows, np.maximum(before, 0)], np.nan)
    right = np.where(after < width, disparity[rows, np.minimum(after, width - 1)], np.nan)
    return fill_nearest(np.where(unknown, np.fmin(left, right), disparity).astype(np.float32))

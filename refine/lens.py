"""Where to look closely: the piece of a frame that shows a depth boundary (the paper's Fig. 1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, uniform_filter

BOUNDARY_JUMP = 3.0
"""Disparity difference between neighbours that makes a depth boundary, in pixels."""
_BAND = 6
"""Half width of the band around a boundary in which errors are called halo, in pixels."""
_ERROR_CAP = 10.0
"""Errors above it count as this much, so that one wild pixel does not choose the place."""


def boundary_window(
    disparity: NDArray[np.float32], truth: NDArray[np.float32], size: tuple[int, int]
) -> tuple[slice, slice] | None:
    """The window in which the initial disparity errs most along depth boundaries.

    Chosen from the initial disparity and the ground truth alone, so it does not flatter the refinement.

    Args:
        disparity: (H, W) initial disparity.
        truth: (H, W) ground truth, NaN where unknown.
        size: Height and width of the window, cut to the frame's.

    Returns:
        Rows and columns, or None where the frame has no depth boundary.
    """
    across = np.abs(np.diff(truth, axis=1, append=truth[:, -1:])) > BOUNDARY_JUMP
    down = np.abs(np.diff(truth, axis=0, append=truth[-1:])) > BOUNDARY_JUMP
    if not (across | down).any():
        return None
    band = binary_dilation(across | down, iterations=_BAND)
    error = np.nan_to_num(np.minimum(np.abs(disparity - truth), _ERROR_CAP), nan=0.0)
    height, width = min(size[0], truth.shape[0]), min(size[1], truth.shape[1])
    score = uniform_filter(np.where(band, error, 0.0), size=(height, width), mode="constant")
    row, column = np.unravel_index(np.argmax(score), score.shape)
    top = int(np.clip(row - height // 2, 0, truth.shape[0] - height))
    left = int(np.clip(column - width // 2, 0, truth.shape[1] - width))
    return slice(top, top + height), slice(left, left + width)

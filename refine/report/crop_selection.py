"""Crops to look at closely: pieces of a frame along depth boundaries, as in the paper's Fig. 1."""

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

Window = tuple[slice, slice]
"""Rows and columns."""


def most_improved_boundary(
    initial: NDArray[np.float32],
    refined: NDArray[np.float32],
    truth: NDArray[np.float32],
    size: tuple[int, int],
) -> Window | None:
    """The window in which refinement removes most error along depth boundaries.

    Args:
        initial, refined: (H, W) disparities before and after.
        truth: (H, W) ground truth, NaN where unknown.
        size: Height and width of the window, cut to the frame's.

    Returns:
        The window, or None where the frame has no depth boundary.
    """
    return _best_window(_capped_error(initial, truth) - _capped_error(refined, truth), truth, size)


def worst_boundary(
    disparity: NDArray[np.float32], truth: NDArray[np.float32], size: tuple[int, int]
) -> Window | None:
    """The window with the largest error along depth boundaries (see `most_improved_boundary`)."""
    return _best_window(_capped_error(disparity, truth), truth, size)


def _best_window(
    score: NDArray[np.float32], truth: NDArray[np.float32], size: tuple[int, int]
) -> Window | None:
    across = np.abs(np.diff(truth, axis=1, append=truth[:, -1:])) > BOUNDARY_JUMP
    down = np.abs(np.diff(truth, axis=0, append=truth[-1:])) > BOUNDARY_JUMP
    if not (across | down).any():
        return None
    band = binary_dilation(across | down, iterations=_BAND)
    height, width = min(size[0], truth.shape[0]), min(size[1], truth.shape[1])
    sums = uniform_filter(np.where(band, score, 0.0), size=(height, width), mode="constant")
    # Only windows that lie inside the frame compete.
    top, left = height // 2, width // 2
    inside = sums[top : top + truth.shape[0] - height + 1, left : left + truth.shape[1] - width + 1]
    row, column = (int(place) for place in np.unravel_index(np.argmax(inside), inside.shape))
    return slice(row, row + height), slice(column, column + width)


def _capped_error(disparity: NDArray[np.float32], truth: NDArray[np.float32]) -> NDArray[np.float32]:
    """|d - d*| up to the cap: the cap where the estimate is missing, 0 where the ground truth is."""
    error = np.nan_to_num(np.abs(disparity - truth), nan=_ERROR_CAP)
    capped: NDArray[np.float32] = np.where(np.isfinite(truth), np.minimum(error, _ERROR_CAP), 0)
    return capped

"""Gradient targets: forward differences of a disparity map, and where they are valid.

Pure functions of arrays. Camera frame: x right, y up, looking along -z; pixel (row i, column j) is seen
through its centre (j + 0.5, i + 0.5); the principal point is the image's middle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SAME_SURFACE = 1e-4
"""Share of the distance within which a hit still counts as the surface itself.

Occlusion rays are cast with 32-bit floats. Two surfaces this close differ by less than 0.02 px at the largest
disparities.
"""


def forward_differences(disparity: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, 2) forward differences [dx, dy] of a disparity map (H, W), as in section 2 of the paper.

    They are 0 in the last column (dx) and the last row (dy), where they would leave the image.
    """
    gradient = np.zeros((*disparity.shape, 2), np.float32)
    gradient[:, :-1, 0] = disparity[:, 1:] - disparity[:, :-1]
    gradient[:-1, :, 1] = disparity[1:] - disparity[:-1]
    return gradient


def gradient_validity(gradient: NDArray[np.float32], threshold_px: float) -> NDArray[np.bool_]:
    """(H, W) True where both differences of an (H, W, 2) gradient exist and neither exceeds the threshold.

    The last column and row have no forward difference. A larger one is a discontinuity, which the paper masks
    out of GradNet's loss. NaN is not valid.
    """
    valid = (np.abs(gradient) <= threshold_px).all(axis=-1)
    valid[:, -1] = False
    valid[-1, :] = False
    return valid

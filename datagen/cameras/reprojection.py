"""From disparities to depths and points, by the calibration of a rectified pair."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.cameras.calibration import Calibration
from stereoforge_kit.errors import InputError
from stereoforge_kit.messages import listed


def depth_of_disparity(disparity: NDArray[np.floating[Any]], calibration: Calibration) -> NDArray[np.float64]:
    """Depth along the optical axis: fx * baseline / (disparity + doffs).

    Args:
        disparity: (H, W) px of the left view, of images as the calibration has them; NaN where there is none.
        calibration: Of the pair.

    Returns:
        (H, W) metres; infinite where the disparity is that of infinity or beyond, NaN where there is none.

    Raises ValueError for a calibration of images of another size.

    >>> rig = Calibration(fx=500, fy=500, cx_left=1, cx_right=1, cy=0, baseline_m=0.1)
    >>> depth_of_disparity(np.array([[10.0, 0.0, np.nan]]), rig).tolist()
    [[5.0, inf, nan]]
    """
    height, width = disparity.shape
    if calibration.size not in (None, (width, height)):
        raise InputError(
            f"the disparity is {width}x{height} and the calibration is of images of "
            f"{listed(calibration.size or (), separator='x')}"
        )
    parallax = disparity.astype(np.float64) + calibration.doffs
    with np.errstate(divide="ignore"):
        return np.asarray(calibration.fx * calibration.baseline_m / np.maximum(parallax, 0.0))


def points_of_depth(depth: NDArray[np.floating[Any]], calibration: Calibration) -> NDArray[np.float64]:
    """The points that a depth map shows, in the left camera's coordinates as OpenCV has them: x right, y down, z ahead.

    Args:
        depth: (H, W) metres.
        calibration: Of the pair.

    Returns:
        (H, W, 3) metres; not finite where the depth is not.

    >>> rig = Calibration(fx=500, fy=500, cx_left=1, cx_right=1, cy=0, baseline_m=0.1)
    >>> points_of_depth(np.array([[5.0, 5.0, 10.0]]), rig).tolist()
    [[[-0.01, 0.0, 5.0], [0.0, 0.0, 5.0], [0.02, 0.0, 10.0]]]
    """
    height, width = depth.shape
    across = (np.arange(width) - calibration.cx_left) / calibration.fx
    down = (np.arange(height) - calibration.cy) / calibration.fy
    with np.errstate(invalid="ignore"):
        return np.stack([depth * across, depth * down[:, None], depth], axis=-1)

"""Tell whether two rectified views are swapped, by the share of pixels that can be matched."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from stereoforge_kit.matching.sgbm import SGBMParameters, match_sgbm

WIDTH_PX = 320
"""Of the reduced views that are matched."""
TALLEST_PX = 8 * WIDTH_PX
"""Narrower pictures are reduced to this height instead."""
SEARCHED = SGBMParameters(max_disparity_px=64)
CLEARLY = 1.1
"""Swapped, pairs of every family here and two photographs matched at 0.4 to 0.8 of the pixels that they match at."""


def seem_swapped(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> bool:
    """Whether more pixels can be matched with the views swapped.

    Args:
        left, right: (H, W, 3) uint8, rectified.
    """
    height, width = left.shape[:2]
    size = (WIDTH_PX, max(1, round(height * WIDTH_PX / width)))
    if size[1] > TALLEST_PX:
        size = (max(1, round(width * TALLEST_PX / height)), TALLEST_PX)
    one, other = (cv2.resize(view, size, interpolation=cv2.INTER_AREA) for view in (left, right))
    return _share_matched(other, one) > CLEARLY * _share_matched(one, other)


def _share_matched(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> float:
    """The share of the left view that semi-global matching is sure of."""
    return float(np.isfinite(match_sgbm(left, right, SEARCHED)).mean())

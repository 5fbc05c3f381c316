"""Confidence and gradients without networks, from left-right consistency, texture and the disparity itself.

`stereoforge refine` uses them for a disparity of another predictor where a run folder has no regressor-free networks
(ours). They are simple on purpose: the networks do better.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from refine.baselines.wmf import weighted_median

Map = NDArray[np.float32]

CONSISTENT_PX = 1.0
"""Left-right difference at which confidence has fallen to exp(-1/2)."""
UNCONFIRMED = 0.05
"""Confidence where the right view has nothing to compare with."""
TEXTURE = 4.0
"""Standard deviation of grey around a pixel, in 8-bit units, at which texture counts for 63 %."""
TEXTURE_WINDOW_PX = 7
UNTEXTURED = 0.2
"""Share of the confidence that is left where there is no texture."""

SLOPE_REACH_PX = 4
"""Slopes are taken over twice so many pixels, since matchers resolve a fraction of one only."""
STEEPEST = 1.0
"""Steeper slopes are edges."""
SLOPE_WINDOW_RADIUS_PX = 7
SLOPE_SIGMA = 15.0


def consistency_confidence(disparity: Map, consistency: Map, image: NDArray[np.uint8]) -> Map:
    """exp(-c^2 / 2) of the left-right difference c in pixels, lowered where the image has no texture.

    Args:
        disparity: (H, W), NaN in holes, whose confidence is 0.
        consistency: (H, W), negative where there is nothing to compare with (`matching.left_right_consistency`).
        image: (H, W, 3).

    Returns:
        (H, W) in [0, 1].
    """
    grey = image.astype(np.float32).mean(axis=2)
    size = (TEXTURE_WINDOW_PX, TEXTURE_WINDOW_PX)
    mean, squares = (cv2.blur(m, size, borderType=cv2.BORDER_REFLECT) for m in (grey, grey**2))
    deviation = np.sqrt(np.maximum(squares - mean**2, 0))
    texture = UNTEXTURED + (1 - UNTEXTURED) * (1 - np.exp(-deviation / TEXTURE))
    agreement = np.where(consistency < 0, UNCONFIRMED, np.exp(-0.5 * (consistency / CONSISTENT_PX) ** 2))
    return np.where(np.isnan(disparity), 0, agreement * texture).astype(np.float32)


def local_gradients(disparity: Map, confidence: Map, image: NDArray[np.uint8]) -> Map:
    """Gradients (H, W, 2) [dx, dy]: in each direction the weighted median of nearby slopes, in pixels per pixel.

    Pixels of similar colour weigh most. Slopes between pixels that are unknown, have a confidence below 1/2, or are as
    steep as an edge do not count; where none counts the gradient is 0. Arguments as for `consistency_confidence`.
    """
    sure = np.where(confidence < 0.5, np.nan, disparity).astype(np.float32)
    slopes = []
    for axis in (1, 0):
        ahead, behind = (_shifted(sure, axis, step) for step in (SLOPE_REACH_PX, -SLOPE_REACH_PX))
        slope = (ahead - behind) / np.float32(2 * SLOPE_REACH_PX)
        slope[np.abs(slope) > STEEPEST] = np.nan
        slopes.append(weighted_median(slope, image, SLOPE_WINDOW_RADIUS_PX, SLOPE_SIGMA))
    return np.nan_to_num(np.stack(slopes, axis=2), nan=0.0)


def _shifted(values: Map, axis: int, step: int) -> Map:
    """The value `step` pixels further along an axis, NaN where that is outside."""
    shifted = np.roll(values, -step, axis=axis)
    edge = slice(-step, None) if step > 0 else slice(None, -step)
    shifted[(slice(None),) * axis + (edge,)] = np.nan
    return shifted

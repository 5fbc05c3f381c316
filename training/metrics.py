"""Validation figures of tensors, as `refine.metrics` measures them.

Which pixels count is said there and nowhere else: ground truth that is NaN leaves a pixel out, an empty mask gives NaN,
and an estimate that is NaN is bad in every rate and left out of every mean. The functions here only bring tensors into
the shape that those take; all images of a batch are pooled. A validation leaves frames whose figure is NaN for want of
ground truth out of its mean (`StereoTask.validation_step`).
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from refine import metrics

AUC_STEPS = 20
"""Steps of the sparsification curve: few, since the curve is measured for every validation frame."""


def end_point_error(disparity: Tensor, truth: Tensor) -> float:
    """Mean |d - d*| in pixels (`refine.metrics.end_point_error`).

    Args:
        disparity: (B, 1, H, W) px.
        truth: (B, 1, H, W) px, NaN where unknown.
    """
    return metrics.end_point_error(_as_map(disparity), _as_map(truth))


def bad_pixel_rate(disparity: Tensor, truth: Tensor, threshold_px: float = 1.0) -> float:
    """Share (0..1) of pixels with |d - d*| above the threshold (`refine.metrics.bad_pixel_rate`).

    Arguments as for `end_point_error`.
    """
    return metrics.bad_pixel_rate(_as_map(disparity), _as_map(truth), threshold_px)


def gradient_error(gradient: Tensor, truth: Tensor, threshold_px: float) -> float:
    """Mean |gx - gx*| plus mean |gy - gy*| on smooth pixels, px per px (`refine.metrics.gradient_error`).

    Args:
        gradient: (B, 2, H, W) as [dx, dy].
        truth: (B, 2, H, W), NaN where unknown.
        threshold_px: Pixels with a larger true difference are discontinuities (`refine.metrics.smooth_mask`).
    """
    expected = _as_gradient(truth)
    return metrics.gradient_error(
        _as_gradient(gradient), expected, metrics.smooth_mask(expected, threshold_px)
    )


def forward_gradient(disparity: Tensor) -> Tensor:
    """Forward differences [dx, dy] of (B, 1, H, W), as (B, 2, H, W); NaN where a pixel has no neighbour."""
    maps = [metrics.forward_gradient(each[0]) for each in disparity.float().cpu().numpy()]
    return torch.from_numpy(np.stack(maps)).permute(0, 3, 1, 2).to(disparity)


def sparsification_auc(
    confidence: Tensor, disparity: Tensor, truth: Tensor, threshold_px: float = 1.0
) -> float:
    """Area under the bad-pixel rate of the pixels kept, against the share removed, least confident first.

    By `refine.metrics.sparsification_curve`, where a random order of equally confident pixels is averaged over.

    Args:
        confidence: (B, 1, H, W), higher is surer.
        disparity, truth: As for `end_point_error`.
        threshold_px: Larger errors are bad.
    """
    return metrics.sparsification_curve(
        _as_map(disparity), _as_map(truth), _as_map(confidence), threshold_px, steps=AUC_STEPS
    ).auc


def _as_map(maps: Tensor) -> NDArray[np.float32]:
    """(B, 1, H, W) as one map of (B * H, W)."""
    batch, _, height, width = maps.shape
    return maps.float().cpu().numpy().reshape(batch * height, width)


def _as_gradient(maps: Tensor) -> NDArray[np.float32]:
    """(B, 2, H, W) as one map of (B * H, W, 2)."""
    batch, _, height, width = maps.shape
    return maps.float().permute(0, 2, 3, 1).cpu().numpy().reshape(batch * height, width, 2)

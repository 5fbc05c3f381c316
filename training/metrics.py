"""Validation figures. Every function gives NaN where no pixel counts."""

from __future__ import annotations

import torch
from torch import Tensor

BAD_PX = 1.0
AUC_STEPS = 20


def end_point_error(disparity: Tensor, truth: Tensor) -> Tensor:
    """Mean |d - d*| over valid pixels."""
    return (disparity - truth).abs().nanmean()


def bad_rate(disparity: Tensor, truth: Tensor, threshold_px: float = BAD_PX) -> Tensor:
    """Share of valid pixels with |d - d*| > threshold."""
    error = (disparity - truth).abs()
    return (error[~torch.isnan(error)] > threshold_px).float().mean()


def gradient_error(gradient: Tensor, truth: Tensor, threshold_px: float) -> Tensor:
    """Mean |gx - gx*| + |gy - gy*| over pixels whose true differences exist and are not above the threshold.

    Args:
        gradient, truth: (B, 2, H, W), NaN in `truth` where there is none.
    """
    mask = (truth.abs() <= threshold_px).all(dim=1)
    return (gradient - truth).abs().sum(dim=1)[mask].mean()


def forward_differences(disparity: Tensor) -> Tensor:
    """(B, 1, H, W) to (B, 2, H, W), [dx, dy]; NaN in the last column and row."""
    gradient = torch.full_like(disparity.repeat(1, 2, 1, 1), torch.nan)
    gradient[:, 0, :, :-1] = disparity[:, 0, :, 1:] - disparity[:, 0, :, :-1]
    gradient[:, 1, :-1, :] = disparity[:, 0, 1:, :] - disparity[:, 0, :-1, :]
    return gradient


def sparsification_auc(
    confidence: Tensor, disparity: Tensor, truth: Tensor, threshold_px: float = BAD_PX
) -> Tensor:
    """Area under bad rate of the kept pixels against the share removed, least confident first (trapezoids)."""
    error = (disparity - truth).abs().flatten()
    valid = ~torch.isnan(error)
    bad = (error[valid] > threshold_px).double()
    bad = bad[torch.argsort(confidence.flatten()[valid], descending=True, stable=True)]
    removed = torch.arange(AUC_STEPS, dtype=torch.float64, device=bad.device) / AUC_STEPS
    kept = (bad.numel() * (1 - removed)).round().long().clamp(min=1)
    rates = bad.cumsum(0)[kept - 1] / kept
    return torch.trapezoid(torch.cat([rates, rates[-1:]]), dx=1 / AUC_STEPS).float()


def optimal_auc(rate: Tensor) -> Tensor:
    """The least possible area for a bad rate e: e + (1 - e) ln(1 - e) (Hu & Mordohai 2012)."""
    missed: Tensor = torch.special.xlog1py(1 - rate, -rate)
    return rate + missed

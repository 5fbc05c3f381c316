"""The losses of the four tasks. NaN marks pixels without truth; they never enter a mean."""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

ScaleWeights = tuple[float, ...]
"""Weights of the losses at 1/64, 1/32, .. 1/2."""

STAGE_WEIGHTS: tuple[ScaleWeights, ...] = (
    (1.0, 0.2, 0.0, 0.0, 0.0, 0.0),
    (0.5, 1.0, 0.2, 0.0, 0.0, 0.0),
    (0.0, 0.5, 1.0, 0.2, 0.0, 0.0),
    (0.0, 0.0, 0.5, 1.0, 0.2, 0.0),
    (0.0, 0.0, 0.0, 0.5, 1.0, 0.2),
    (0.0, 0.0, 0.0, 0.0, 0.5, 1.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
)
"""One row a stage, from coarse to fine: DispNet's training schedule as its authors gave it."""

STATIC_WEIGHTS: ScaleWeights = (0.2, 0.2, 0.2, 0.2, 0.2, 1.0)
"""The weights in DispNet's released training definition, which started from trained weights."""


def stage_weights(step: int, stages: Sequence[ScaleWeights], ends: Sequence[int]) -> ScaleWeights:
    """The weights in force at a step.

    Args:
        stages: the weights of each stage.
        ends: step at which each stage but the last ends, not decreasing.

    Raises:
        ValueError: the numbers of stages and ends do not fit.
    """
    if len(ends) != len(stages) - 1:
        raise ValueError(f"{len(stages)} loss stages need {len(stages) - 1} ends, got {tuple(ends)}")
    return stages[sum(step >= end for end in ends)]


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of `values` where `mask`; 0 (with a gradient of 0) where the mask is empty.

    With several processes, a process's sum over the mean count of all of them: averaged over the processes, as
    their gradients are, that is the mean over all their pixels, however unevenly the valid ones fall.
    """
    count = mask.sum()
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        torch.distributed.all_reduce(count)
        count = count / torch.distributed.get_world_size()
    # `where` before the sum: NaN * 0 is NaN, in the backward pass too.
    return torch.where(mask, values, 0.0).sum() / torch.where(count > 0, count, 1)


def downsample_disparity(truth: Tensor, size: tuple[int, int]) -> Tensor:
    """Average a disparity over each coarse pixel's area, over valid pixels only.

    Values stay in pixels of the full resolution.

    Args:
        truth: (B, 1, H, W), NaN invalid.
        size: (h, w), each dividing H and W.

    Returns:
        (B, 1, h, w), NaN where no pixel of the area is valid.
    """
    kernel = (truth.shape[-2] // size[0], truth.shape[-1] // size[1])
    valid = ~torch.isnan(truth)
    total = F.avg_pool2d(torch.where(valid, truth, 0.0), kernel)
    share = F.avg_pool2d(valid.to(truth.dtype), kernel)
    return total / share  # 0 / 0 is the NaN that is wanted


def disparity_l1(prediction: Tensor, truth: Tensor) -> Tensor:
    """Mean |relu(prediction) - truth| over valid pixels; disparity is never negative."""
    return masked_mean((F.relu(prediction) - truth).abs(), ~torch.isnan(truth))


def multiscale_l1(predictions: Sequence[Tensor], truth: Tensor, weights: Sequence[float]) -> Tensor:
    """Weighted sum of `disparity_l1` over the scales, each against the truth averaged down to it.

    Args:
        predictions: (B, 1, h, w) each, in pixels of the full resolution.
        truth: (B, 1, H, W), NaN invalid.
        weights: one a prediction; scales of weight 0 cost nothing.
    """
    losses = [
        weight
        * disparity_l1(prediction, downsample_disparity(truth, (prediction.shape[-2], prediction.shape[-1])))
        for prediction, weight in zip(predictions, weights, strict=True)
        if weight > 0
    ]
    return torch.stack(losses).sum()


def gradient_aware_l1(prediction: Tensor, truth: Tensor, gradient_weight: float) -> Tensor:
    """Eq. 9: mean |l| + lambda mean(|dx l| + |dy l|), l = prediction - truth, by forward differences.

    Args:
        prediction, truth: (B, 1, H, W); a difference counts where both its pixels are valid.
        gradient_weight: lambda, 5 in the paper.
    """
    error = F.relu(prediction) - truth
    along_x = error[..., :, 1:] - error[..., :, :-1]
    along_y = error[..., 1:, :] - error[..., :-1, :]
    gradients = masked_mean(along_x.abs(), ~torch.isnan(along_x)) + masked_mean(
        along_y.abs(), ~torch.isnan(along_y)
    )
    return masked_mean(error.abs(), ~torch.isnan(error)) + gradient_weight * gradients


def confidence_cross_entropy(
    logits: Tensor, disparity: Tensor, truth: Tensor, correct_within_px: float
) -> Tensor:
    """Cross-entropy of (wrong, correct) against the label |d - d*| <= t, over valid pixels.

    Args:
        logits: (B, 2, H, W).
        disparity: (B, 1, H, W), the regressor's.
        truth: (B, 1, H, W), NaN invalid.
        correct_within_px: t.
    """
    error = (disparity - truth).abs()
    labels = (error <= correct_within_px).long()
    return masked_mean(F.cross_entropy(logits, labels[:, 0], reduction="none"), ~torch.isnan(error[:, 0]))


def refinement_l1(
    refined: Tensor, truth: Tensor, gradient: Tensor, gradient_weight: float, threshold_px: float
) -> Tensor:
    """Mean |d - d*| of a refined disparity, and so many times `masked_gradient_l1` of its forward differences (ours).

    Args:
        refined, truth: (B, 1, H, W), NaN in `truth` where there is none.
        gradient: (B, 2, H, W) forward differences of the truth, NaN where there is none.
        gradient_weight: As lambda in eq. 9.
        threshold_px: Larger true differences are discontinuities.
    """
    across = F.pad(refined.diff(dim=3), (0, 1))
    downwards = F.pad(refined.diff(dim=2), (0, 0, 0, 1))
    inside = F.pad(torch.ones_like(refined[..., 1:, 1:]), (0, 1, 0, 1)) > 0
    slopes = masked_gradient_l1(
        torch.cat([across, downwards], dim=1), torch.where(inside, gradient, torch.nan), threshold_px
    )
    return masked_mean((refined - truth).abs(), ~torch.isnan(truth)) + gradient_weight * slopes


def masked_gradient_l1(prediction: Tensor, gradient: Tensor, threshold_px: float) -> Tensor:
    """Mean over unmasked pixels of |gx - gx*| + |gy - gy*|.

    A pixel is masked where a difference is missing or larger than the threshold: there is a discontinuity, not
    a surface.

    Args:
        prediction: (B, 2, H, W).
        gradient: (B, 2, H, W) forward differences of the truth, NaN where there is none.
        threshold_px: 1 in the paper as far as it can be read.
    """
    mask = (gradient.abs() <= threshold_px).all(dim=1)  # NaN compares false
    return masked_mean((prediction - gradient).abs().sum(dim=1), mask)

"""The losses of all tasks. Pixels without ground truth (NaN) never enter a mean."""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

ScaleWeights = tuple[float, ...]
"""Weights of the losses at 1/64, 1/32, ..., 1/2 of the resolution."""

STAGE_WEIGHTS: tuple[ScaleWeights, ...] = (
    (1.0, 0.2, 0.0, 0.0, 0.0, 0.0),
    (0.5, 1.0, 0.2, 0.0, 0.0, 0.0),
    (0.0, 0.5, 1.0, 0.2, 0.0, 0.0),
    (0.0, 0.0, 0.5, 1.0, 0.2, 0.0),
    (0.0, 0.0, 0.0, 0.5, 1.0, 0.2),
    (0.0, 0.0, 0.0, 0.0, 0.5, 1.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
)
"""One row per stage, from coarse to fine: DispNet's training schedule as its authors gave it."""

STATIC_WEIGHTS: ScaleWeights = (0.2, 0.2, 0.2, 0.2, 0.2, 1.0)
"""The weights in DispNet's released training definition, which continues from trained weights."""


def stage_weights(progress: float, stages: Sequence[ScaleWeights], ends: Sequence[float]) -> ScaleWeights:
    """The weights that apply at a point of the run.

    Args:
        progress: Share of the run that is done, from 0.
        stages: The weights of each stage.
        ends: Share of the run at which each stage but the last ends, not decreasing.

    Raises:
        ValueError: there is not one end fewer than stages.
    """
    if len(ends) != len(stages) - 1:
        raise ValueError(f"{len(stages)} loss stages need {len(stages) - 1} ends, got {tuple(ends)}")
    return stages[sum(progress >= end for end in ends)]


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of `values` where `mask` is true; 0 (with a gradient of 0) if the mask is empty.

    Under torchrun a process divides its sum by the mean count of all processes. Averaged over the processes, as their
    gradients are, this is the mean over all their pixels, however unevenly the valid ones are distributed.

    Args:
        values: Any shape; NaN outside the mask does no harm.
        mask: bool, of the same shape.
    """
    count = mask.sum()
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        torch.distributed.all_reduce(count)
        count = count / torch.distributed.get_world_size()
    # `where` before the sum: NaN * 0 is NaN, in the backward pass too.
    return torch.where(mask, values, 0.0).sum() / torch.where(count > 0, count, 1)


def downsample_disparity(truth: Tensor, size: tuple[int, int]) -> Tensor:
    """Average a ground-truth disparity over the area of each coarse pixel.

    The values stay in pixels of the full resolution. Only valid pixels are averaged over.

    Args:
        truth: (B, 1, H, W), NaN invalid.
        size: (h, w), which divide H and W.

    Returns:
        (B, 1, h, w), NaN where no pixel of the area is valid.
    """
    kernel = (truth.shape[-2] // size[0], truth.shape[-1] // size[1])
    valid = ~torch.isnan(truth)
    total = F.avg_pool2d(torch.where(valid, truth, 0.0), kernel)
    share = F.avg_pool2d(valid.to(truth.dtype), kernel)
    return total / share  # 0 / 0 is the NaN that is wanted


def disparity_l1(prediction: Tensor, truth: Tensor) -> Tensor:
    """Mean |relu(prediction) - truth| over valid pixels; disparity is never negative.

    Args:
        prediction: (B, 1, H, W) px.
        truth: (B, 1, H, W) px, NaN invalid.
    """
    return masked_mean((F.relu(prediction) - truth).abs(), ~torch.isnan(truth))


def multiscale_l1(predictions: Sequence[Tensor], truth: Tensor, weights: Sequence[float]) -> Tensor:
    """Weighted sum of `disparity_l1` over the scales (Mayer et al. 2016).

    Each prediction is compared with the ground truth averaged down to its scale.

    Args:
        predictions: (B, 1, h, w) each, in pixels of the full resolution.
        truth: (B, 1, H, W), NaN invalid.
        weights: One per prediction. Scales of weight 0 are not computed.
    """
    losses = [
        weight
        * disparity_l1(prediction, downsample_disparity(truth, (prediction.shape[-2], prediction.shape[-1])))
        for prediction, weight in zip(predictions, weights, strict=True)
        if weight > 0
    ]
    return torch.stack(losses).sum()


def disparity_smooth_l1(prediction: Tensor, truth: Tensor, beta_px: float) -> Tensor:
    """Mean smooth L1 over valid pixels: squared below `beta_px`, linear above (Girshick, ICCV 2015).

    Args:
        prediction: (B, 1, H, W) px.
        truth: (B, 1, H, W) px, NaN invalid.
        beta_px: Errors below this count by their squares.
    """
    valid = ~torch.isnan(truth)
    error = F.smooth_l1_loss(prediction, torch.where(valid, truth, 0.0), beta=beta_px, reduction="none")
    return masked_mean(error, valid)


CENTRAL_PIXELS = ((1, 1), (1, 2), (2, 1), (2, 2))
"""Row and column of the pixels in a cell of 4x4 whose ground truth stands for it."""


def level_cross_entropy(scores: Tensor, truth: Tensor, spread: float) -> Tensor:
    """Cross-entropy of a volume's softmax against Laplacians about the ground truth.

    A cell of the volume covers 4x4 pixels. Its target is the mean of the distributions of its central pixels, so a cell
    on an edge has two peaks.

    Args:
        scores: (B, h, w, D), logits.
        truth: (B, 1, 4h, 4w) in levels, NaN invalid.
        spread: Scale of the Laplacian in levels.
    """
    cells = torch.stack([truth[:, 0, row::4, column::4] for row, column in CENTRAL_PIXELS])
    valid = ~torch.isnan(cells)
    levels = torch.arange(scores.shape[-1], device=scores.device, dtype=scores.dtype)
    distances = (torch.where(valid, cells, 0.0)[..., None] - levels).abs()
    targets = (-distances / spread).softmax(-1)
    return masked_mean(-(targets * scores.log_softmax(-1)).sum(-1), valid)


def gradient_aware_l1(prediction: Tensor, truth: Tensor, gradient_weight: float) -> Tensor:
    """Eq. 9 of the paper: mean |l| + lambda mean(|dx l| + |dy l|) with l = prediction - truth.

    dx and dy are forward differences; one counts where both its pixels are valid.

    Args:
        prediction: (B, 1, H, W) px.
        truth: (B, 1, H, W) px, NaN invalid.
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
    """ConfNet's loss: cross-entropy of (wrong, correct) against the label |d - d*| <= t, over valid pixels.

    Args:
        logits: (B, 2, H, W).
        disparity: (B, 1, H, W) px, the estimate that is judged.
        truth: (B, 1, H, W) px, NaN invalid.
        correct_within_px: t.
    """
    error = (disparity - truth).abs()
    labels = (error <= correct_within_px).long()
    return masked_mean(F.cross_entropy(logits, labels[:, 0], reduction="none"), ~torch.isnan(error[:, 0]))


def refinement_l1(
    refined: Tensor, truth: Tensor, gradient: Tensor, gradient_weight: float, threshold_px: float
) -> Tensor:
    """Mean |d - d*| of a refined disparity plus the weighted `masked_gradient_l1` of its forward differences (ours).

    Args:
        refined: (B, 1, H, W) px.
        truth: (B, 1, H, W) px, NaN invalid.
        gradient: (B, 2, H, W) forward differences of the ground truth, NaN invalid.
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
    """GradNet's loss: mean of |gx - gx*| + |gy - gy*| over smooth pixels.

    A pixel is left out where a true difference is missing or above the threshold: there is a discontinuity, not a
    surface.

    Args:
        prediction: (B, 2, H, W) px per px.
        gradient: (B, 2, H, W) forward differences of the ground truth, NaN invalid.
        threshold_px: 1 in the paper, as far as the digit can be read.
    """
    mask = (gradient.abs() <= threshold_px).all(dim=1)  # NaN compares false
    return masked_mean((prediction - gradient).abs().sum(dim=1), mask)

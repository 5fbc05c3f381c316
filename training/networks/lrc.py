"""Left-right consistency, the third input of ConfNet (eq. 1 of the paper)."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

INCONSISTENT = -1.0
"""Value of pixels whose match lies outside the right image."""


def left_right_consistency(disparity_left: Tensor, disparity_right: Tensor) -> Tensor:
    """Eq. 1: C(i, j) = |d_l(i, j) - d_r(i, j - d_l(i, j))|, or -1 where j - d_l(i, j) leaves the image.

    The right map is sampled at the nearest pixel, as the field's code does. The paper counts columns from 1, so
    its "j - d_l > 0" is "column index >= 0" here.

    Args:
        disparity_left, disparity_right: (B, 1, H, W), finite, in pixels of these maps.

    Returns:
        (B, 1, H, W).
    """
    width = disparity_left.shape[-1]
    columns = torch.arange(width, device=disparity_left.device)
    # floor(x + 1/2), since torch.round would send ties to even columns.
    matches = torch.floor(columns - disparity_left + 0.5).long()
    inside = (matches >= 0) & (matches < width)
    sampled = disparity_right.gather(-1, matches.clamp(0, width - 1))
    return torch.where(inside, (disparity_left - sampled).abs(), INCONSISTENT)


def predict_right(predict_left: Callable[[Tensor, Tensor], Tensor], left: Tensor, right: Tensor) -> Tensor:
    """The right view's disparity from a predictor of left ones: mirror both, swap, predict, mirror back.

    Args:
        predict_left: maps (left, right) images to a disparity (B, 1, H, W).
        left, right: (B, 3, H, W).
    """
    return predict_left(right.flip(-1), left.flip(-1)).flip(-1)

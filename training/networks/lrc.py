"""Left-right consistency, the third input of ConfNet (eq. 1 of the paper)."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

INCONSISTENT = -1.0
"""Value of pixels whose match lies outside the right image."""


def left_right_consistency(disparity_left: Tensor, disparity_right: Tensor) -> Tensor:
    """Difference in pixels between a disparity and that of its match in the right view (eq. 1).

    C(i, j) = |d_l(i, j) - d_r(i, j - d_l(i, j))|, or -1 where j - d_l(i, j) leaves the image. The right map is sampled
    at the nearest pixel, as other implementations do. The paper counts columns from 1, so its "j - d_l > 0" is
    "column index >= 0" here.

    Args:
        disparity_left, disparity_right: (B, 1, H, W), finite, in pixels of these maps.

    Returns:
        (B, 1, H, W).

    Examples:
        >>> left = torch.tensor([[[[0.0, 1.0, 1.0, 2.0]]]])
        >>> right = torch.tensor([[[[1.0, 1.5, 0.0, 0.0]]]])
        >>> left_right_consistency(left, right).flatten().tolist()
        [1.0, 0.0, 0.5, 0.5]
        >>> left_right_consistency(left + 2, right).flatten().tolist()
        [-1.0, -1.0, -1.0, -1.0]
    """
    width = disparity_left.shape[-1]
    columns = torch.arange(width, device=disparity_left.device)
    # floor(x + 1/2), since torch.round would send ties to even columns.
    matches = torch.floor(columns - disparity_left + 0.5).long()
    inside = (matches >= 0) & (matches < width)
    sampled = disparity_right.gather(-1, matches.clamp(0, width - 1))
    return torch.where(inside, (disparity_left - sampled).abs(), INCONSISTENT)


def predict_right(predict_left: Callable[[Tensor, Tensor], Tensor], left: Tensor, right: Tensor) -> Tensor:
    """Predict the right view's disparity with a predictor of the left view's.

    The swapped views, both mirrored, are a rectified pair again; its disparity is mirrored back.

    Args:
        predict_left: Maps (left, right) images to a disparity (B, 1, H, W).
        left, right: (B, 3, H, W).

    Returns:
        (B, 1, H, W), positive where `predict_left` gives positive disparities.

    Examples:
        >>> left, right = torch.rand(2, 1, 3, 4, 6)
        >>> red = predict_right(lambda reference, other: reference[:, :1], left, right)
        >>> torch.equal(red, right[:, :1])
        True
    """
    return predict_left(right.flip(-1), left.flip(-1)).flip(-1)

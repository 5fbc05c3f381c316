"""What a training step and a validation step receive."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor


class StereoBatch(NamedTuple):
    """Rectified pairs with the ground truth of their left views.

    A single sample, before torch's default collation stacks several, has the same fields without the axis B.
    """

    left: Tensor
    """(B, 3, H, W) sRGB in 0..1."""
    right: Tensor
    """(B, 3, H, W) sRGB in 0..1."""
    disparity: Tensor
    """(B, 1, H, W) px of these crops or frames, NaN where unknown."""
    gradient: Tensor
    """(B, 2, H, W) forward differences [dx, dy] in px per px, NaN where unknown."""

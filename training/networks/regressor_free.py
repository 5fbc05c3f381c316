"""Inputs of the regressor-free ConfNet and GradNet, which judge the disparity of any predictor (ours).

In place of a regressor's matching features they take maps made from the disparity itself. So they work on the output of
semi-global matching, of another network or of a depth sensor. The networks are the same otherwise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from numpy.typing import NDArray
from torch import Tensor

from stereoforge_kit.matching import SGBMParameters, fill_background, left_right_consistency, match_both
from training.networks.cost_features import RESIDUAL_CEILING_PX, limited_slopes

Float32 = NDArray[np.float32]

REGRESSOR_FREE_CHANNELS = 6
"""Channels of `disparity_features`."""
CONFIRMED_WITHIN_PX = 1.0
"""A left-right difference up to this confirms a pixel."""
RESIDUAL_WINDOW_PX = 9
"""Width of the square window whose mean disparity a pixel's is compared with."""


class RegressorFreeInputs(NamedTuple):
    """A predictor's disparity for a batch of pairs, as the networks take it."""

    disparity: Tensor
    """(B, 1, H, W) px of the left view, holes filled from the background beside them."""
    known: Tensor
    """(B, 1, H, W), 1 where the predictor gave a disparity, 0 in holes."""
    consistency: Tensor
    """(B, 1, H, W) px, the left-right-consistency map (`stereoforge_kit.matching.left_right_consistency`)."""

    @property
    def features(self) -> Tensor:
        """`disparity_features`, (B, `REGRESSOR_FREE_CHANNELS`, H, W)."""
        return disparity_features(*self)


def disparity_features(disparity: Tensor, known: Tensor, consistency: Tensor) -> Tensor:
    """Make the maps that take the place of a regressor's matching features.

    Args:
        disparity, known, consistency: The fields of `RegressorFreeInputs`.

    Returns:
        (B, 6, H, W): the disparity, whether it is known, whether the right view confirms it, its clipped forward
        differences, and its clipped distance to the mean around it. All but the first are bounded.

    Examples:
        >>> disparity = torch.full((1, 1, 4, 5), 7.0)
        >>> features = disparity_features(disparity, torch.ones_like(disparity), torch.zeros_like(disparity))
        >>> features[0, :, 0, 0].tolist()
        [7.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    """
    confirmed = ((consistency >= 0) & (consistency <= CONFIRMED_WITHIN_PX)).to(disparity.dtype)
    reach = RESIDUAL_WINDOW_PX // 2
    mean = F.avg_pool2d(disparity, RESIDUAL_WINDOW_PX, 1, reach, count_include_pad=False)
    residual = (disparity - mean).clamp(-RESIDUAL_CEILING_PX, RESIDUAL_CEILING_PX)
    return torch.cat([disparity, known, confirmed, limited_slopes(disparity), residual], dim=1)


def regressor_free_inputs(disparity: Float32, disparity_right: Float32) -> RegressorFreeInputs:
    """Make the inputs of one pair, a batch of one.

    A map without any disparity becomes 0 (infinitely far) everywhere, and unknown.

    Args:
        disparity, disparity_right: (H, W) px of the left and of the right view, NaN in holes.

    Examples:
        >>> inputs = regressor_free_inputs(np.full((4, 5), 2, np.float32), np.full((4, 5), 2, np.float32))
        >>> inputs.disparity.shape, inputs.features.shape
        (torch.Size([1, 1, 4, 5]), torch.Size([1, 6, 4, 5]))
    """
    consistency = left_right_consistency(disparity, disparity_right)
    known = np.isfinite(disparity)
    filled = np.nan_to_num(fill_background(disparity.astype(np.float32)), nan=0.0)
    maps = (filled, known.astype(np.float32), consistency)
    return RegressorFreeInputs(*(torch.from_numpy(np.ascontiguousarray(m))[None, None] for m in maps))


def match_batch(left: Tensor, right: Tensor, parameters: SGBMParameters) -> RegressorFreeInputs:
    """Match pairs by semi-global matching, both views, and make the networks' inputs.

    Args:
        left, right: (B, 3, H, W) in 0..1; rounded to 8 bits for the matcher.
        parameters: Of the matcher.
    """
    views = [(v.clamp(0, 1) * 255).round().byte().permute(0, 2, 3, 1).cpu().numpy() for v in (left, right)]
    pairs = zip(*(np.ascontiguousarray(view) for view in views), strict=True)
    matches = [regressor_free_inputs(*match_both(one, other, parameters)) for one, other in pairs]
    return RegressorFreeInputs(*(torch.cat(maps).to(left.device) for maps in zip(*matches, strict=True)))

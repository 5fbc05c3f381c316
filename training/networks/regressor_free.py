"""ConfNet and GradNet without a regressor: for the disparity of any predictor.

In place of a regressor's matching features they see maps made from the disparity itself, so they work on what
semi-global matching, another network or a sensor gives. The networks are the same otherwise.
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


class RegressorFreeInputs(NamedTuple):
    """What the networks see of a predictor's answer to a batch."""

    disparity: Tensor
    """(B, 1, H, W) px, holes filled from the background beside them."""
    known: Tensor
    """(B, 1, H, W), 1 where the predictor gave a disparity, 0 in holes."""
    consistency: Tensor
    """(B, 1, H, W) left-right-consistency map (`matching.left_right_consistency`)."""

    @property
    def features(self) -> Tensor:
        return disparity_features(*self)


def disparity_features(disparity: Tensor, known: Tensor, consistency: Tensor) -> Tensor:
    """(B, 6, H, W): disparity, whether it is known, whether the right view confirms it, its forward differences, and
    how far it is from its surroundings' mean; all but the first bounded. Arguments as in `RegressorFreeInputs`."""
    confirmed = ((consistency >= 0) & (consistency <= CONFIRMED_WITHIN_PX)).to(disparity.dtype)
    reach = RESIDUAL_WINDOW_PX // 2
    mean = F.avg_pool2d(disparity, RESIDUAL_WINDOW_PX, 1, reach, count_include_pad=False)
    residual = (disparity - mean).clamp(-RESIDUAL_CEILING_PX, RESIDUAL_CEILING_PX)
    return torch.cat([disparity, known, confirmed, limited_slopes(disparity), residual], dim=1)


def regressor_free_inputs(disparity: Float32, disparity_right: Float32) -> RegressorFreeInputs:
    """The inputs of one pair, a batch of one, from both views' disparities (H, W) in pixels, NaN in holes.

    A map without any disparity is taken as infinitely far, unknown everywhere.
    """
    consistency = left_right_consistency(disparity, disparity_right)
    known = np.isfinite(disparity)
    filled = np.nan_to_num(fill_background(disparity.astype(np.float32)), nan=0.0)
    maps = (filled, known.astype(np.float32), consistency)
    return RegressorFreeInputs(*(torch.from_numpy(np.ascontiguousarray(m))[None, None] for m in maps))


def match_batch(left: Tensor, right: Tensor, parameters: SGBMParameters) -> RegressorFreeInputs:
    """Semi-global matching of images (B, 3, H, W) in 0..1, as the networks see it."""
    views = [(v.clamp(0, 1) * 255).round().byte().permute(0, 2, 3, 1).cpu().numpy() for v in (left, right)]
    pairs = zip(*(np.ascontiguousarray(view) for view in views), strict=True)
    answers = [regressor_free_inputs(*match_both(one, other, parameters)) for one, other in pairs]
    return RegressorFreeInputs(*(torch.cat(maps).to(left.device) for maps in zip(*answers, strict=True)))

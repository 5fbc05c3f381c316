"""What the networks say about a pair of any size. Used by validation and by `StereoPredictor` alike."""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from training.networks import (
    ConfNet,
    DispNetCorr1D,
    GradNet,
    HeadConfig,
    full_resolution,
    left_right_consistency,
)
from training.networks.cost_features import Evidence
from training.networks.regressors.dispnet import STRIDE


class Regression(NamedTuple):
    """A regressor's answer to a batch."""

    disparity: Tensor
    """(B, 1, H, W) px of the input, not negative."""
    features: Tensor
    """(B, F, H/2, W/2) matching features."""
    decoded: Tensor
    """(B, F, H/2, W/2) what the disparity was made of."""

    def features_for(self, config: HeadConfig) -> Tensor:
        """The features that a head was trained on."""
        return self.features if config.features == "joined" else self.decoded


class HeadInputs(NamedTuple):
    """What ConfNet and GradNet see of a batch; empty where there is no such network."""

    regression: Regression
    """What they are about."""
    confnet: tuple[Tensor, ...]
    gradnet: tuple[Tensor, ...]


class Estimate(NamedTuple):
    """The networks' answer to a batch; None where there is no such network."""

    disparity: Tensor
    """(B, 1, H, W) px of the input."""
    confidence: Tensor | None
    """(B, 1, H, W) in 0..1."""
    gradient: Tensor | None
    """(B, 2, H, W) px per pixel, [dx, dy]."""


def regress(regressor: DispNetCorr1D, left: Tensor, right: Tensor) -> Regression:
    """Disparity and features of images (B, 3, H, W) whose sides are multiples of 64."""
    output = regressor(left, right)
    disparity = F.relu(full_resolution(output.disparities[-1], left.shape[-2:]))
    return Regression(disparity, output.features, output.decoded)


def regress_consistently(regressor: DispNetCorr1D, left: Tensor, right: Tensor) -> tuple[Regression, Tensor]:
    """Disparity and features of the left view, and the left-right-consistency map (B, 1, H, W), in one pass.

    The right view's disparity is that of the mirrored, swapped pair (`predict_right`), here in the same batch.
    """
    batch = left.shape[0]
    both = regress(regressor, torch.cat([left, right.flip(-1)]), torch.cat([right, left.flip(-1)]))
    disparity_left, disparity_right = both.disparity[:batch], both.disparity[batch:].flip(-1)
    consistency = left_right_consistency(disparity_left, disparity_right)
    return Regression(disparity_left, both.features[:batch], both.decoded[:batch]), consistency


def head_inputs(
    regressor: DispNetCorr1D, confnet: ConfNet | None, gradnet: GradNet | None, left: Tensor, right: Tensor
) -> HeadInputs:
    """What the heads that there are take of images whose sides are multiples of 64; the regressor runs once."""
    for_confnet: tuple[Tensor, ...] = ()
    if confnet is None:
        regression = regress(regressor, left, right)
        evidence = Evidence(left, right, regression.disparity)
    else:
        regression, consistency = regress_consistently(regressor, left, right)
        evidence = Evidence(left, right, regression.disparity)
        for_confnet = confnet.inputs(regression.features_for(confnet.config), consistency, evidence)
    for_gradnet: tuple[Tensor, ...] = ()
    if gradnet is not None:
        for_gradnet = gradnet.inputs(regression.features_for(gradnet.config), evidence)
    return HeadInputs(regression, for_confnet, for_gradnet)


def network_size(height: int, width: int) -> tuple[int, int]:
    """The next multiples of 64, which the original network resizes its input to."""
    return -(-height // STRIDE) * STRIDE, -(-width // STRIDE) * STRIDE


@torch.no_grad()
def estimate(
    regressor: DispNetCorr1D, confnet: ConfNet | None, gradnet: GradNet | None, left: Tensor, right: Tensor
) -> Estimate:
    """Resize to multiples of 64 (no padding), predict, resize back.

    With the input stretched by (sx, sy), a disparity comes out sx times too large, the horizontal gradient
    unchanged (disparity and pixel stretch alike), the vertical one sx / sy times too large.

    Args:
        left, right: (B, 3, H, W) in 0..1.
    """
    height, width = left.shape[-2:]
    inner_height, inner_width = network_size(height, width)
    left, right = (resize(view, inner_height, inner_width) for view in (left, right))
    stretch_x, stretch_y = inner_width / width, inner_height / height

    seen = head_inputs(regressor, confnet, gradnet, left, right)
    confidence = gradient = None
    if confnet is not None:
        confidence = resize(confnet.confidence(*seen.confnet), height, width)
    if gradnet is not None:
        gradient = resize(gradnet(*seen.gradnet), height, width)
        gradient = gradient * gradient.new_tensor([1.0, stretch_y / stretch_x]).view(1, 2, 1, 1)
    return Estimate(resize(seen.regression.disparity, height, width) / stretch_x, confidence, gradient)


def resize(maps: Tensor, height: int, width: int) -> Tensor:
    """Bilinear, with the filter widened when shrinking; the same maps when the size is right already."""
    if maps.shape[-2:] == (height, width):
        return maps
    return F.interpolate(maps, size=(height, width), mode="bilinear", align_corners=False, antialias=True)

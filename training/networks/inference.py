"""The networks run together: disparity, confidence and gradient of pairs of any size.

Training, validation and `training.prediction.predictor.StereoPredictor` all go through here.
"""

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
from training.networks.cost_features import CostFeatures
from training.networks.regressors.dispnet import STRIDE


class Regression(NamedTuple):
    """A regressor's output for a batch, at full resolution."""

    disparity: Tensor
    """(B, 1, H, W) px of the input, not negative."""
    features: Tensor
    """(B, F, H/2, W/2) matching features."""
    decoded: Tensor
    """(B, F, H/2, W/2) decoded features (`DispNetOutput.decoded`)."""

    def features_for(self, config: HeadConfig) -> Tensor:
        """The features that a head of this config takes."""
        return self.features if config.features == "joined" else self.decoded


class HeadInputs(NamedTuple):
    """Inputs of ConfNet and GradNet for a batch; empty for a network that there is not."""

    regression: Regression
    """The disparity that the networks judge, and its features."""
    confnet: tuple[Tensor, ...]
    """What `ConfNet.forward` takes."""
    gradnet: tuple[Tensor, ...]
    """What `GradNet.forward` takes."""


class Estimate(NamedTuple):
    """The networks' outputs for a batch; None for a network that there is not."""

    disparity: Tensor
    """(B, 1, H, W) px of the input, not negative."""
    confidence: Tensor | None
    """(B, 1, H, W) in 0..1."""
    gradient: Tensor | None
    """(B, 2, H, W) px per pixel, [dx, dy]."""


def regress(regressor: DispNetCorr1D, left: Tensor, right: Tensor) -> Regression:
    """Predict the left view's disparity.

    Args:
        regressor: The network.
        left, right: (B, 3, H, W) in 0..1, H and W multiples of 64.

    Examples:
        >>> from training.networks import DispNetConfig
        >>> regressor = DispNetCorr1D(DispNetConfig(width=0.0625)).eval()
        >>> regress(regressor, *torch.rand(2, 1, 3, 64, 64)).disparity.shape
        torch.Size([1, 1, 64, 64])
    """
    output = regressor(left, right)
    disparity = F.relu(full_resolution(output.disparities[-1], left.shape[-2:]))
    return Regression(disparity, output.features, output.decoded)


def regress_consistently(regressor: DispNetCorr1D, left: Tensor, right: Tensor) -> tuple[Regression, Tensor]:
    """Predict the left view's disparity and the left-right-consistency map (B, 1, H, W) in one forward pass.

    The right view's disparity is that of the swapped views, mirrored (`predict_right`), in the same batch. Arguments as
    for `regress`.
    """
    batch = left.shape[0]
    both = regress(regressor, torch.cat([left, right.flip(-1)]), torch.cat([right, left.flip(-1)]))
    disparity_left, disparity_right = both.disparity[:batch], both.disparity[batch:].flip(-1)
    consistency = left_right_consistency(disparity_left, disparity_right)
    return Regression(disparity_left, both.features[:batch], both.decoded[:batch]), consistency


def head_inputs(
    regressor: DispNetCorr1D, confnet: ConfNet | None, gradnet: GradNet | None, left: Tensor, right: Tensor
) -> HeadInputs:
    """Run the regressor once and collect the inputs of the heads that there are.

    Args:
        regressor: The network that predicts the disparity.
        confnet, gradnet: None for a head that is not there.
        left, right: (B, 3, H, W) in 0..1, H and W multiples of 64.
    """
    for_confnet: tuple[Tensor, ...] = ()
    if confnet is None:
        regression = regress(regressor, left, right)
        cost_features = CostFeatures(left, right, regression.disparity)
    else:
        regression, consistency = regress_consistently(regressor, left, right)
        cost_features = CostFeatures(left, right, regression.disparity)
        for_confnet = confnet.inputs(regression.features_for(confnet.config), consistency, cost_features)
    for_gradnet: tuple[Tensor, ...] = ()
    if gradnet is not None:
        for_gradnet = gradnet.inputs(regression.features_for(gradnet.config), cost_features)
    return HeadInputs(regression, for_confnet, for_gradnet)


def network_size(height: int, width: int) -> tuple[int, int]:
    """The size that an image is resized to, as the original network does: the next multiples of 64, (height, width).

    Examples:
        >>> network_size(375, 1242)
        (384, 1280)
    """
    return -(-height // STRIDE) * STRIDE, -(-width // STRIDE) * STRIDE


@torch.no_grad()
def estimate(
    regressor: DispNetCorr1D, confnet: ConfNet | None, gradnet: GradNet | None, left: Tensor, right: Tensor
) -> Estimate:
    """Predict disparity, confidence and gradient of images of any size.

    The images are resized to multiples of 64, not padded, and the outputs are resized back. With the input stretched by
    (sx, sy), a disparity comes out sx times too large. The horizontal gradient comes out unchanged, since disparity and
    pixels are stretched alike; the vertical one comes out sx / sy times too large. All are corrected here.

    Args:
        regressor, confnet, gradnet: The networks, in evaluation mode; None for a head that is not there.
        left, right: (B, 3, H, W) in 0..1.

    Examples:
        >>> from training.networks import DispNetConfig
        >>> regressor = DispNetCorr1D(DispNetConfig(width=0.0625)).eval()
        >>> found = estimate(regressor, None, None, *torch.rand(2, 1, 3, 50, 70))
        >>> found.disparity.shape, found.confidence
        (torch.Size([1, 1, 50, 70]), None)
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
    """Resize maps (B, C, h, w) bilinearly to (B, C, height, width), antialiased when shrinking.

    Returns the maps themselves if they have that size already.
    """
    if maps.shape[-2:] == (height, width):
        return maps
    return F.interpolate(maps, size=(height, width), mode="bilinear", align_corners=False, antialias=True)

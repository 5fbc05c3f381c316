"""The networks run together: disparity, confidence and gradient of pairs of any size.

Training, validation and `training.prediction.predictor.StereoPredictor` all go through here.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import torch
from torch import Tensor

from training.networks.confnet import ConfNet
from training.networks.cost_features import CostFeatures
from training.networks.gradnet import GradNet
from training.networks.lrc import left_right_consistency
from training.networks.regressors.interface import Fitting, Regression, Regressor

DIFFERENT_PX = 1.5
"""Two answers whose disparities differ by more are different answers."""
SURER_BY = 0.1
"""A second answer must be surer by more than this to be taken."""


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


def regress(regressor: Regressor, left: Tensor, right: Tensor, stretch: float | None = None) -> Regression:
    """Predict the left view's disparity.

    Args:
        regressor: The network.
        left, right: (B, 3, H, W) in 0..1, H and W multiples of the network's stride.
        stretch: How many times wider than whole pictures these are (`Fitting.stretch`). Disparities are in pixels of
            `left`; how far the network looks is in those of the pictures. None for crops, in which `forward` decides.

    Examples:
        >>> from training.networks import DispNetConfig, DispNetCorr1D
        >>> regressor = DispNetCorr1D(DispNetConfig(width=0.0625)).eval()
        >>> regress(regressor, *torch.rand(2, 1, 3, 64, 64)).disparity.shape
        torch.Size([1, 1, 64, 64])
    """
    output = regressor(left, right) if stretch is None else regressor.see(left, right, stretch)
    return regressor.regression(output)


def regress_consistently(
    regressor: Regressor, left: Tensor, right: Tensor, stretch: float | None = None
) -> tuple[Regression, Tensor]:
    """Predict the left view's disparity and the left-right-consistency map (B, 1, H, W) in one forward pass.

    The right view's disparity is that of the swapped views, mirrored (`predict_right`), in the same batch. Arguments as
    for `regress`.
    """
    batch = left.shape[0]
    views = torch.cat([left, right.flip(-1)]), torch.cat([right, left.flip(-1)])
    both = regress(regressor, *views, stretch)
    disparity_left, disparity_right = both.disparity[:batch], both.disparity[batch:].flip(-1)
    consistency = left_right_consistency(disparity_left, disparity_right)
    features = {kind: maps[:batch] for kind, maps in both.features.items()}
    return Regression(disparity_left, features), consistency


def head_inputs(
    regressor: Regressor,
    confnet: ConfNet | None,
    gradnet: GradNet | None,
    left: Tensor,
    right: Tensor,
    stretch: float | None = None,
) -> HeadInputs:
    """Run the regressor once and collect the inputs of the heads that there are.

    Args:
        regressor: The network that predicts the disparity.
        confnet, gradnet: None for a head that is not there.
        left, right: (B, 3, H, W) in 0..1, H and W multiples of the regressor's stride.
        stretch: As for `regress`.
    """
    for_confnet: tuple[Tensor, ...] = ()
    if confnet is None:
        regression = regress(regressor, left, right, stretch)
        cost_features = CostFeatures(left, right, regression.disparity)
    else:
        regression, consistency = regress_consistently(regressor, left, right, stretch)
        cost_features = CostFeatures(left, right, regression.disparity)
        for_confnet = confnet.inputs(regression.features[confnet.config.features], consistency, cost_features)
    for_gradnet: tuple[Tensor, ...] = ()
    if gradnet is not None:
        for_gradnet = gradnet.inputs(regression.features[gradnet.config.features], cost_features)
    return HeadInputs(regression, for_confnet, for_gradnet)


@torch.no_grad()
def estimate(
    regressor: Regressor, confnet: ConfNet | None, gradnet: GradNet | None, left: Tensor, right: Tensor
) -> Estimate:
    """Predict disparity, confidence and gradient of images of any size.

    The images are brought to multiples of the regressor's stride as it wants them, and the outputs are brought back. If
    it sees them at two sizes and there is a ConfNet, the surer answer is taken at each pixel (`surer`).

    Args:
        regressor, confnet, gradnet: The networks, in evaluation mode; None for a head that is not there.
        left, right: (B, 3, H, W) in 0..1.

    Examples:
        >>> from training.networks import DispNetConfig, DispNetCorr1D
        >>> regressor = DispNetCorr1D(DispNetConfig(width=0.0625)).eval()
        >>> found = estimate(regressor, None, None, *torch.rand(2, 1, 3, 50, 70))
        >>> found.disparity.shape, found.confidence
        (torch.Size([1, 1, 50, 70]), None)
    """
    fittings = regressor.fittings(*left.shape[-2:])
    answers = [
        _estimate_at(fitting, regressor, confnet, gradnet, left, right)
        for fitting in (fittings if confnet is not None else fittings[:1])
    ]
    return functools.reduce(surer, answers)


def _estimate_at(
    fitting: Fitting,
    regressor: Regressor,
    confnet: ConfNet | None,
    gradnet: GradNet | None,
    left: Tensor,
    right: Tensor,
) -> Estimate:
    """`estimate` of images at one size.

    With the input stretched by (sx, sy), a disparity comes out sx times too large. The horizontal gradient comes out
    unchanged, since disparity and pixels are stretched alike; the vertical one comes out sx / sy times too large. All
    are corrected here.
    """
    stretch_x, stretch_y = fitting.stretch
    views = fitting.apply(left), fitting.apply(right)
    seen = head_inputs(regressor, confnet, gradnet, *views, stretch_x)
    confidence = gradient = None
    if confnet is not None:
        confidence = fitting.undo(confnet.confidence(*seen.confnet))
    if gradnet is not None:
        gradient = fitting.undo(gradnet(*seen.gradnet))
        gradient = gradient * gradient.new_tensor([1.0, stretch_y / stretch_x]).view(1, 2, 1, 1)
    return Estimate(fitting.undo(seen.regression.disparity) / stretch_x, confidence, gradient)


def surer(first: Estimate, second: Estimate) -> Estimate:
    """The first answer, but the second where both differ and that is surer.

    Args:
        first, second: Of one pair, with confidences.

    Examples:
        >>> first = Estimate(torch.tensor([5.0, 5.0, 5.0]), torch.tensor([0.5, 0.5, 0.9]), None)
        >>> second = Estimate(torch.tensor([5.5, 9.0, 9.0]), torch.tensor([0.9, 0.9, 0.9]), None)
        >>> surer(first, second).disparity.tolist()
        [5.0, 9.0, 5.0]
    """
    assert first.confidence is not None
    assert second.confidence is not None
    differ = (first.disparity - second.disparity).abs() > DIFFERENT_PX
    better = differ & (second.confidence > first.confidence + SURER_BY)
    gradient = None
    if first.gradient is not None and second.gradient is not None:
        gradient = torch.where(better, second.gradient, first.gradient)
    return Estimate(
        torch.where(better, second.disparity, first.disparity),
        torch.where(better, second.confidence, first.confidence),
        gradient,
    )

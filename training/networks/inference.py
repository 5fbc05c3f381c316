"""The networks run together: disparity, confidence and gradient of pairs of any size.

Training, validation and `training.prediction.predictor.StereoPredictor` all go through here.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import torch
from torch import Tensor

from training.networks.confnet import ConfNet
from training.networks.cost_features import CostFeatures
from training.networks.gradnet import GradNet
from training.networks.lrc import left_right_consistency
from training.networks.regressors.interface import Regression, Regressor, resize

DIFFERENT_PX = 1.5
"""Two answers whose disparities differ by more are different answers."""
SURER_BY = 0.1
"""A second answer must be surer by more than this to be taken."""
REACHED_SHARE = 0.999
"""Of the pixels of a first answer: the second is looked for up to what so many of them reach."""
REACH_MARGIN_PX = 8.0
"""And by this much farther."""


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


def regress_enlarged(
    regressor: Regressor,
    left: Tensor,
    right: Tensor,
    size: tuple[int, int],
    stretch: float,
    up_to: float | None = None,
) -> Regression:
    """What `Regressor.regress` says of the images enlarged, brought back: in pixels, and of the size, of the images.

    Args:
        regressor: The network.
        left, right: (B, 3, H, W) in 0..1.
        size: (height, width) that they are enlarged to, bicubically, which keeps them sharp.
        stretch, up_to: As for `Regressor.regress`.
    """
    height, width = left.shape[-2:]
    factor = size[1] / width
    larger, other = (resize(view, *size, mode="bicubic").clamp(0, 1) for view in (left, right))
    found = regressor.rescaled(regressor.regress(larger, other, stretch * factor, up_to), 1 / factor)
    # Not smoothed, which would mix disparities of two surfaces.
    disparity = resize(found.disparity, height, width, antialias=False)
    features = {
        kind: resize(maps, height // 2, width // 2, antialias=False) for kind, maps in found.features.items()
    }
    return Regression(disparity, features)


def head_inputs(
    regressor: Regressor, confnet: ConfNet | None, gradnet: GradNet | None, left: Tensor, right: Tensor
) -> HeadInputs:
    """Run the regressor once on crops and collect the inputs of the heads that there are.

    Args:
        regressor: The network that predicts the disparity.
        confnet, gradnet: None for a head that is not there.
        left, right: (B, 3, H, W) in 0..1, H and W multiples of the regressor's stride.
    """
    if confnet is None:
        return _inputs(regressor.regress(left, right), None, confnet, gradnet, left, right)
    return _inputs(*regressor.both(left, right), confnet, gradnet, left, right)


def crop_inputs(
    regressor: Regressor,
    confnet: ConfNet | None,
    gradnet: GradNet | None,
    left: Tensor,
    right: Tensor,
    enlarged_share: float,
) -> HeadInputs:
    """What heads are trained on: as `head_inputs`, but the first of the crops are seen enlarged.

    That is for a regressor that sees pictures enlarged, both of whose answers the heads judge in `estimate`. Of another
    regressor it is `head_inputs`.

    Args:
        regressor, confnet, gradnet, left, right: As for `head_inputs`.
        enlarged_share: How many crops are seen enlarged, 0..1, rounded down.
    """
    size, first = regressor.enlarged_size(*left.shape[-2:]), int(enlarged_share * left.shape[0])
    if size is None or first == 0:
        return head_inputs(regressor, confnet, gradnet, left, right)
    disparity_right = None
    if confnet is None:
        own = regressor.regress(left[first:], right[first:])
    else:
        both, disparity_right = regressor.both(left, right)
        own = Regression(both.disparity[first:], {kind: maps[first:] for kind, maps in both.features.items()})
    enlarged = regress_enlarged(regressor, left[:first], right[:first], size, stretch=1.0)
    joined = Regression(
        torch.cat([enlarged.disparity, own.disparity]),
        {kind: torch.cat([enlarged.features[kind], maps]) for kind, maps in own.features.items()},
    )
    return _inputs(joined, disparity_right, confnet, gradnet, left, right)


def _inputs(
    regression: Regression,
    disparity_right: Tensor | None,
    confnet: ConfNet | None,
    gradnet: GradNet | None,
    left: Tensor,
    right: Tensor,
) -> HeadInputs:
    """What the heads see of a regression; a ConfNet needs the right view's disparity."""
    cost_features = CostFeatures(left, right, regression.disparity)
    for_confnet: tuple[Tensor, ...] = ()
    if confnet is not None:
        assert disparity_right is not None
        consistency = left_right_consistency(regression.disparity, disparity_right)
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

    The images are brought to multiples of the regressor's stride as it wants them, and the outputs are brought back.
    Small ones it may see enlarged. With a ConfNet they are seen as they are too, both views, and the surer of the two
    answers is taken at each pixel (`surer`). The heads judge both at the images' own size.

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
    fitting = regressor.fitting(*left.shape[-2:])
    stretch_x, stretch_y = fitting.stretch
    views = fitting.apply(left), fitting.apply(right)
    regressions, disparity_right = _regressions(regressor, *views, stretch_x, with_right=confnet is not None)
    answers = []
    for regression in regressions:
        seen = _inputs(regression, disparity_right, confnet, gradnet, *views)
        confidence = None if confnet is None else confnet.confidence(*seen.confnet)
        gradient = None if gradnet is None else gradnet(*seen.gradnet)
        answers.append(Estimate(regression.disparity, confidence, gradient))
    disparity, confidence, gradient = functools.reduce(surer, answers)
    if confidence is not None:
        confidence = fitting.undo(confidence)
    if gradient is not None:
        # Disparity and columns are stretched alike, so dx stays as it is; dy comes out sx / sy times too large.
        gradient = fitting.undo(gradient) * gradient.new_tensor([1.0, stretch_y / stretch_x]).view(1, 2, 1, 1)
    return Estimate(fitting.undo(disparity) / stretch_x, confidence, gradient)


def _regressions(
    regressor: Regressor, left: Tensor, right: Tensor, stretch: float, with_right: bool
) -> tuple[list[Regression], Tensor | None]:
    """A regressor's answers, the finest first, in pixels of the images, and the right view's disparity if wanted."""
    size = regressor.enlarged_size(*left.shape[-2:])
    if not with_right:
        if size is None:
            return [regressor.regress(left, right, stretch)], None
        return [regress_enlarged(regressor, left, right, size, stretch)], None
    own, disparity_right = regressor.both(left, right, stretch)
    if size is None:
        return [own], disparity_right
    up_to = _reach(own.disparity) / stretch
    return [regress_enlarged(regressor, left, right, size, stretch, up_to), own], disparity_right


def _reach(disparity: Tensor) -> float:
    """How far a second answer is looked for. What few pixels exceed is often wrong, and else the first answer stays."""
    values = disparity.flatten()
    reached = values.kthvalue(math.ceil(REACHED_SHARE * values.numel())).values
    return float(reached) + REACH_MARGIN_PX


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

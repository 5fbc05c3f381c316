"""DispNetCorr1D (Mayer et al., CVPR 2016), the regressor of the method."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.losses import STAGE_WEIGHTS, ScaleWeights, multiscale_l1, stage_weights
from training.networks.correlation import Correlation1D, ShiftedCorrelation1D
from training.networks.initialization import initialize
from training.networks.regressors.interface import (
    FeatureKind,
    Fitting,
    Objective,
    Regression,
    Regressor,
    RegressorConfig,
    Resizing,
)

LEAKY_SLOPE = 0.1
"""Slope of LeakyReLU below zero (the original network definition)."""
CONVOLUTION_WEIGHT = "0.weight"
"""Name of the convolution's weight in what `activated` returns."""
Normalization = Literal["none", "batch"]
"""Of the convolutions: none, as in the original, or BatchNorm."""


@dataclass(frozen=True)
class DispNetConfig(RegressorConfig):
    """Options of the network. The defaults are the original network definition; all else is ours."""

    width: float = 1.0
    """Factor on every channel count but the correlation's."""
    max_displacement: int = 40
    """Largest displacement of the correlation, in pixels at 1/4 resolution."""
    one_sided: bool = False
    """Correlate towards non-negative disparities only. That halves the channels and loses no possible match (ours)."""
    normalization: Normalization = "none"
    """`batch` puts BatchNorm after every convolution but the predictions; short runs need it to converge (ours)."""
    prediction_scale: float = 1.0
    """Pixels per unit of a prediction layer's output. The original predicts pixels (1). With a larger value a short run
    reaches tens of pixels with weights of ordinary size (ours)."""
    residual: bool = False
    """Predict at each scale the difference to the coarser scale's prediction, upsampled bilinearly, instead of the
    disparity itself (ours; cascaded networks such as FADNet do so)."""


class DispNetOutput(NamedTuple):
    """The outputs of one forward pass."""

    disparities: tuple[Tensor, ...]
    """Six maps (B, 1, h, w) from 1/64 to 1/2 of the input, each in pixels of the input; not clipped at zero."""
    features: Tensor
    """The last concatenated matching features, (B, F, H/2, W/2), F = 97 at full width: conv1 of the left view,
    upconv1, and as the last channel pr2 upsampled, in pixels."""
    decoded: Tensor
    """iconv1's output, from which the finest disparity is predicted, (B, 32 at full width, H/2, W/2)."""


def scaled(channels: int, width: float) -> int:
    """A channel count times a width factor, at least 1."""
    return max(1, round(channels * width))


def activated(
    convolution: nn.Module, channels: int, normalization: Normalization, linear: bool = False
) -> nn.Sequential:
    """A convolution, the network's normalisation and, unless `linear`, LeakyReLU.

    Args:
        convolution: The layer.
        channels: Its output channels.
        normalization: As in `DispNetConfig`.
        linear: Leave the LeakyReLU out.
    """
    layers = [convolution]
    if normalization == "batch":
        layers.append(nn.BatchNorm2d(channels))
    if not linear:
        layers.append(nn.LeakyReLU(LEAKY_SLOPE, inplace=True))
    return nn.Sequential(*layers)


def upsampling(in_channels: int, channels: int) -> nn.ConvTranspose2d:
    """A transposed convolution that doubles width and height.

    The original gives it a bias with a learning rate of 0, which stays at 0.
    """
    deconvolution = nn.ConvTranspose2d(in_channels, channels, 4, 2, 1)
    assert deconvolution.bias is not None
    deconvolution.bias.requires_grad_(False)
    return deconvolution


class ExpandingStage(nn.Module):
    """One step of the decoder: upsample features and prediction, join the skip connection, predict anew."""

    def __init__(self, below: int, skip: int, channels: int, config: DispNetConfig) -> None:
        """Make the layers.

        Args:
            below: Channels of the coarser features.
            skip: Channels of the skip connection.
            channels: Channels of this stage's features.
            config: The network's options.
        """
        super().__init__()
        normalization = config.normalization
        self.residual = config.residual
        self.upconv = activated(upsampling(below, channels), channels, normalization)
        self.uppr = upsampling(1, 1)
        joined = skip + channels + 1
        self.iconv = activated(nn.Conv2d(joined, channels, 3, 1, 1), channels, normalization, linear=True)
        self.pr = nn.Conv2d(channels, 1, 3, 1, 1)

    def forward(self, below: Tensor, prediction: Tensor, skip: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Decode one scale.

        Args:
            below: (B, below, h/2, w/2) features of the coarser scale.
            prediction: (B, 1, h/2, w/2) of the coarser scale.
            skip: (B, skip, h, w) from the encoder.

        Returns:
            Features (B, channels, h, w), prediction (B, 1, h, w), and the concatenation that the features were made
            from.
        """
        upsampled = in_full_precision(self.uppr, prediction)
        joined = torch.cat([skip, self.upconv(below), upsampled], dim=1)
        features = self.iconv(joined)
        finer = in_full_precision(self.pr, features)
        if self.residual:
            finer = finer + full_resolution(prediction, finer.shape[-2:])
        return features, finer, joined


@dataclass(frozen=True)
class MultiscaleObjective(Objective):
    """L1 at all scales, with weights that change from stage to stage (Mayer et al. 2016)."""

    stages: tuple[ScaleWeights, ...] = STAGE_WEIGHTS
    """Weights of the six scales' losses, one row per stage."""

    def __call__(self, output: DispNetOutput, disparity: Tensor, progress: float) -> Tensor:
        """`multiscale_l1` of a batch with the weights of the current stage."""
        weights = stage_weights(progress, self.stages, self.stage_ends)
        return multiscale_l1(output.disparities, disparity, weights)


class DispNetCorr1D(Regressor):
    """Disparity from a rectified pair: two shared convolutions, a 1-D correlation, an encoder and a decoder.

    `DispNetCorr1D()` is the network as its authors released it (Mayer et al., CVPR 2016): 42,430,107 parameters, of
    which 997 are the transposed convolutions' biases, frozen at zero. The original predicts negative numbers, clipped
    at zero; this is the same network with the opposite sign, so the loss and the user take relu(prediction).

    Examples:
        >>> network = DispNetCorr1D(DispNetConfig(width=0.0625)).eval()
        >>> left, right = torch.rand(2, 1, 3, 64, 128)
        >>> output = network(left, right)
        >>> [tuple(disparity.shape[-2:]) for disparity in output.disparities]
        [(1, 2), (2, 4), (4, 8), (8, 16), (16, 32), (32, 64)]
        >>> output.features.shape
        torch.Size([1, 7, 32, 64])
    """

    name = "dispnet"
    title = "DispNetCorr1D"
    config_type = DispNetConfig
    stride = 64

    def __init__(self, config: DispNetConfig | None = None) -> None:
        """Make the network with new weights; without a config, the original's."""
        self.config: DispNetConfig
        config = config or DispNetConfig()
        super().__init__(config)

        def conv(in_channels: int, out_channels: int, kernel: int, stride: int) -> nn.Sequential:
            layer = nn.Conv2d(in_channels, out_channels, kernel, stride, kernel // 2)
            return activated(layer, out_channels, config.normalization)

        c32, c64, c128, c256, c512, c1024 = (scaled(c, config.width) for c in (32, 64, 128, 256, 512, 1024))
        self.conv1 = conv(3, c64, 7, 2)
        self.conv2 = conv(c64, c128, 5, 2)
        correlation = Correlation1D(config.max_displacement, config.one_sided)
        self.correlation: Correlation1D | ShiftedCorrelation1D = correlation
        self.conv_redir = conv(c128, c64, 1, 1)
        self.conv3 = conv(correlation.out_channels + c64, c256, 5, 2)
        self.conv3_1 = conv(c256, c256, 3, 1)
        self.conv4 = conv(c256, c512, 3, 2)
        self.conv4_1 = conv(c512, c512, 3, 1)
        self.conv5 = conv(c512, c512, 3, 2)
        self.conv5_1 = conv(c512, c512, 3, 1)
        self.conv6 = conv(c512, c1024, 3, 2)
        self.conv6_1 = conv(c1024, c1024, 3, 1)
        self.pr6 = nn.Conv2d(c1024, 1, 3, 1, 1)
        self.stage5 = ExpandingStage(c1024, c512, c512, config)
        self.stage4 = ExpandingStage(c512, c512, c256, config)
        self.stage3 = ExpandingStage(c256, c256, c128, config)
        self.stage2 = ExpandingStage(c128, c128, c64, config)
        self.stage1 = ExpandingStage(c64, c64, c32, config)
        self.feature_channels: dict[FeatureKind, int] = {"joined": c64 + c32 + 1, "decoded": c32}
        self.register_buffer("image_mean", torch.full((3,), 0.4))
        initialize(self)

    def decayed_parameters(self) -> Iterable[nn.Parameter]:
        """Weights of the encoder's convolutions (the contracting part), the only ones with weight decay in the
        original."""
        parts = [self.conv1, self.conv2, self.conv_redir, self.conv3, self.conv3_1, self.conv4, self.conv4_1]
        parts += [self.conv5, self.conv5_1, self.conv6, self.conv6_1]
        return [p for part in parts for name, p in part.named_parameters() if name == CONVOLUTION_WEIGHT]

    def forward(self, left: Tensor, right: Tensor) -> DispNetOutput:
        """Predict the left view's disparity.

        Args:
            left, right: (B, 3, H, W) in 0..1, H and W multiples of 64.

        Raises:
            ValueError: the images differ in size, or a size is no multiple of 64.
        """
        self.check_images(left, right)
        batch = left.shape[0]
        mean = self.image_mean.view(1, 3, 1, 1)
        views1 = self.conv1(torch.cat([left, right]) - mean)
        views2 = self.conv2(views1)
        conv1, conv2 = views1[:batch], views2[:batch]
        cost = self.correlation(conv2, views2[batch:])
        conv3 = self.conv3_1(self.conv3(torch.cat([cost, self.conv_redir(conv2)], dim=1)))
        conv4 = self.conv4_1(self.conv4(conv3))
        conv5 = self.conv5_1(self.conv5(conv4))
        features = self.conv6_1(self.conv6(conv5))
        prediction = in_full_precision(self.pr6, features)

        predictions = [prediction]
        joined = features
        stages = (self.stage5, self.stage4, self.stage3, self.stage2, self.stage1)
        for stage, skip in zip(stages, (conv5, conv4, conv3, conv2, conv1), strict=True):
            features, prediction, joined = stage(features, prediction, skip)
            predictions.append(prediction)
        scale = self.config.prediction_scale
        return DispNetOutput(
            disparities=tuple(scale * p for p in predictions),
            features=torch.cat([joined[:, :-1], scale * joined[:, -1:]], dim=1),
            decoded=features,
        )

    def regression(self, output: DispNetOutput) -> Regression:
        """The finest disparity at full resolution, and iconv1's input and output as features.

        The paper's "last concatenated matching features" are iconv1's input, as the words say, or its output.
        """
        size = [2 * length for length in output.features.shape[-2:]]
        disparity = F.relu(full_resolution(output.disparities[-1], size))
        return Regression(disparity, {"joined": output.features, "decoded": output.decoded})

    def fitting(self, height: int, width: int) -> Fitting:
        """Images are resized to multiples of 64, not padded, as the original network does."""
        return Resizing(height, width, self.stride)

    def exportable(self) -> DispNetCorr1D:
        """The network with its correlation as shifted products, whose graph is the same for every image size."""
        correlation = self.correlation
        assert isinstance(correlation, Correlation1D)
        network = copy.copy(self)
        network._modules = dict(self._modules)
        network.correlation = ShiftedCorrelation1D(correlation)
        return network


def in_full_precision(layer: nn.Module, maps: Tensor) -> Tensor:
    """Run a layer that outputs disparity with 32 bits, under mixed precision too.

    bfloat16 would store a disparity of 100 px with an error of up to a quarter of a pixel.
    """
    with torch.autocast(maps.device.type, enabled=False):
        result: Tensor = layer(maps.float())
    return result


def full_resolution(disparity: Tensor, size: Sequence[int]) -> Tensor:
    """Resize a prediction (B, 1, h, w) to (B, 1, H, W) bilinearly.

    The values stay as they are: every scale predicts in pixels of the input.

    Args:
        disparity: (B, 1, h, w) px of the input.
        size: (H, W).

    Examples:
        >>> full_resolution(torch.full((1, 1, 2, 3), 7.0), (4, 6)).unique()
        tensor([7.])
    """
    return F.interpolate(disparity, size=tuple(size), mode="bilinear", align_corners=False)

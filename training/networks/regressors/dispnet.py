"""DispNetCorr1D (Mayer et al., CVPR 2016), the regressor of the method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.networks.correlation import Correlation1D

LEAKY_SLOPE = 0.1
CONVOLUTION_WEIGHT = "0.weight"
"""Name of the weight of the convolution in what `activated` returns."""
STRIDE = 64
"""Input sides must be multiples of this."""

Normalization = Literal["none", "batch"]
FeatureKind = Literal["joined", "decoded"]
"""What "the last concatenated matching features" are: iconv1's input, as the words say, or its output."""


@dataclass(frozen=True)
class DispNetConfig:
    """What may vary about the network; the defaults are the published one."""

    width: float = 1.0
    """Factor on every channel count but the correlation's."""
    max_displacement: int = 40
    """Reach of the correlation in pixels at 1/4 resolution."""
    one_sided: bool = False
    """Correlate towards non-negative disparities only: half the channels, nothing that could match is lost."""
    normalization: Normalization = "none"
    """`batch` puts BatchNorm after every convolution but the predictions, which short runs need to converge."""
    prediction_scale: float = 1.0
    """Pixels a unit of a prediction layer's output stands for. The original predicts pixels directly (1); a
    larger value lets a run of few steps reach tens of pixels with weights of ordinary size (ours)."""
    residual: bool = False
    """Predict at each scale what is to be added to the coarser scale's prediction, upsampled bilinearly, instead of
    the disparity anew (ours; cascaded and FADNet-like networks do so)."""


class DispNetOutput(NamedTuple):
    """What one pass gives."""

    disparities: tuple[Tensor, ...]
    """Six maps (B, 1, h, w) from 1/64 to 1/2 of the input, each in pixels of the input; not clipped at zero."""
    features: Tensor
    """The last concatenated matching features, (B, F, H/2, W/2), F = 97 at full width: conv1 of the left view,
    upconv1, and as the last channel pr2 upsampled, in pixels."""
    decoded: Tensor
    """What the finest prediction is made of: iconv1's answer to `features`, (B, 32 at full width, H/2, W/2)."""


def scaled(channels: int, width: float) -> int:
    return max(1, round(channels * width))


def activated(
    convolution: nn.Module, channels: int, normalization: Normalization, linear: bool = False
) -> nn.Sequential:
    """A convolution with the network's normalisation and, unless linear, its LeakyReLU."""
    layers = [convolution]
    if normalization == "batch":
        layers.append(nn.BatchNorm2d(channels))
    if not linear:
        layers.append(nn.LeakyReLU(LEAKY_SLOPE, inplace=True))
    return nn.Sequential(*layers)


def upsampling(in_channels: int, channels: int) -> nn.ConvTranspose2d:
    """Learned upsampling by two. The original gives it a bias of learning rate 0 that stays at 0."""
    deconvolution = nn.ConvTranspose2d(in_channels, channels, 4, 2, 1)
    assert deconvolution.bias is not None
    deconvolution.bias.requires_grad_(False)
    return deconvolution


class ExpandingStage(nn.Module):
    """One step of the decoder: upsample features and prediction, join the skip, predict at twice the size."""

    def __init__(self, below: int, skip: int, channels: int, config: DispNetConfig) -> None:
        super().__init__()
        normalization = config.normalization
        self.residual = config.residual
        self.upconv = activated(upsampling(below, channels), channels, normalization)
        self.uppr = upsampling(1, 1)
        joined = skip + channels + 1
        self.iconv = activated(nn.Conv2d(joined, channels, 3, 1, 1), channels, normalization, linear=True)
        self.pr = nn.Conv2d(channels, 1, 3, 1, 1)

    def forward(self, below: Tensor, prediction: Tensor, skip: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        upsampled = in_full_precision(self.uppr, prediction)
        joined = torch.cat([skip, self.upconv(below), upsampled], dim=1)
        features = self.iconv(joined)
        finer = in_full_precision(self.pr, features)
        if self.residual:
            finer = finer + full_resolution(prediction, finer.shape[-2:])
        return features, finer, joined


class DispNetCorr1D(nn.Module):
    """Disparity from a rectified pair: two shared convolutions, a 1-D correlation, an hourglass.

    `DispNetCorr1D()` is the network as released: 42,430,107 parameters, of which 997 are the deconvolutions'
    biases, frozen at zero. The original regresses negative numbers clipped at zero; this is the same network
    with the sign turned, so the loss and the user take relu(prediction).
    """

    image_mean: Tensor

    def __init__(self, config: DispNetConfig | None = None) -> None:
        super().__init__()
        self.config = config = config or DispNetConfig()

        def conv(in_channels: int, out_channels: int, kernel: int, stride: int) -> nn.Sequential:
            layer = nn.Conv2d(in_channels, out_channels, kernel, stride, kernel // 2)
            return activated(layer, out_channels, config.normalization)

        c32, c64, c128, c256, c512, c1024 = (scaled(c, config.width) for c in (32, 64, 128, 256, 512, 1024))
        self.conv1 = conv(3, c64, 7, 2)
        self.conv2 = conv(c64, c128, 5, 2)
        self.correlation = Correlation1D(config.max_displacement, config.one_sided)
        self.conv_redir = conv(c128, c64, 1, 1)
        self.conv3 = conv(self.correlation.out_channels + c64, c256, 5, 2)
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

    def contracting_weights(self) -> list[nn.Parameter]:
        """Weights of the contracting part's convolutions, the only ones the original decays."""
        parts = [self.conv1, self.conv2, self.conv_redir, self.conv3, self.conv3_1, self.conv4, self.conv4_1]
        parts += [self.conv5, self.conv5_1, self.conv6, self.conv6_1]
        return [p for part in parts for name, p in part.named_parameters() if name == CONVOLUTION_WEIGHT]

    def forward(self, left: Tensor, right: Tensor) -> DispNetOutput:
        """Predict the left view's disparity.

        Args:
            left, right: (B, 3, H, W) in 0..1, H and W multiples of 64.

        Raises:
            ValueError: other sizes.
        """
        if left.shape != right.shape or left.shape[-1] % STRIDE or left.shape[-2] % STRIDE:
            raise ValueError(
                f"DispNetCorr1D needs two images of one size, a multiple of {STRIDE} each way; got "
                f"{tuple(left.shape)} and {tuple(right.shape)}"
            )
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


def in_full_precision(layer: nn.Module, maps: Tensor) -> Tensor:
    """A layer that makes pixels of disparity, in 32 bits under mixed precision too: 16 bits hold a disparity of 100
    to half a pixel."""
    with torch.autocast(maps.device.type, enabled=False):
        result: Tensor = layer(maps.float())
    return result


def initialize(network: nn.Module) -> None:
    """MSRA initialisation as Caffe does it (normal, variance 2 / fan-in of the weight blob), biases zero."""
    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)


def full_resolution(disparity: Tensor, size: Sequence[int]) -> Tensor:
    """Bring a prediction (B, 1, h, w) to (B, 1, H, W), bilinearly: values are pixels of the input already."""
    return F.interpolate(disparity, size=tuple(size), mode="bilinear", align_corners=False)

"""The trunk that ConfNet and GradNet share: a small fully convolutional network on image and features."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.networks.regressors.dispnet import LEAKY_SLOPE, DispNetCorr1D, FeatureKind, Normalization

Activation = Literal["relu", "leaky_relu"]


@dataclass(frozen=True)
class HeadConfig:
    """What may vary about ConfNet and GradNet; the paper publishes neither widths nor dropout."""

    feature_channels: int = 97
    """Channels of the regressor's matching features."""
    width: int = 64
    """Channels of the four 3x3 convolutions (ours)."""
    hidden: int = 128
    """Channels of the 1x1 convolution that stands for a full connection (ours)."""
    dropout: float = 0.5
    """Share of hidden channels' pixels dropped in training (ours)."""
    normalization: Normalization = "none"
    """`batch` puts BatchNorm after the 3x3 convolutions."""
    half_resolution: bool = False
    """Work at the features' own resolution and upsample the outputs bilinearly: a quarter of the cost (ours).
    The outputs keep their units: probabilities, and pixels per full-resolution pixel."""
    dilations: tuple[int, int, int, int] = (1, 1, 1, 1)
    """Of the 3x3 convolutions: how far apart, in pixels, they look. Features of a regressor have seen their
    surroundings already; a disparity's own have not (ours)."""
    evidence: bool = False
    """Also see what the pair and the disparity itself say, `training.networks.cost_features` (ours)."""
    features: FeatureKind = "joined"
    """Which features: `joined`, as the paper's words say (97 at full width), or `decoded`, which are 32."""

    def on(self, regressor: DispNetCorr1D) -> HeadConfig:
        """The same for as many channels as this regressor's features have."""
        return replace(self, feature_channels=regressor.feature_channels[self.features])


class PixelHead(nn.Module):
    """Four 3x3 convolutions, a 1x1 convolution as full connection, dropout, a 1x1 output."""

    input_mean: Tensor
    input_std: Tensor

    def __init__(self, config: HeadConfig, extra_channels: int, outputs: int, activation: Activation) -> None:
        super().__init__()
        self.config = config
        in_channels = 3 + config.feature_channels + extra_channels
        self.register_buffer("input_mean", torch.zeros(in_channels))
        self.register_buffer("input_std", torch.ones(in_channels))
        layers: list[nn.Module] = []
        channels = in_channels
        for dilation in config.dilations:
            layers.append(nn.Conv2d(channels, config.width, 3, 1, dilation, dilation))
            if config.normalization == "batch":
                layers.append(nn.BatchNorm2d(config.width))
            layers.append(_activation(activation))
            channels = config.width
        layers += [nn.Conv2d(channels, config.hidden, 1), _activation(activation)]
        layers += [nn.Dropout(config.dropout), nn.Conv2d(config.hidden, outputs, 1)]
        self.layers = nn.Sequential(*layers)
        slope = LEAKY_SLOPE if activation == "leaky_relu" else 0.0
        for layer in self.layers:
            if isinstance(layer, nn.Conv2d):
                nn.init.kaiming_normal_(layer.weight, a=slope)
                assert layer.bias is not None
                nn.init.zeros_(layer.bias)

    def joined_input(self, *inputs: Tensor) -> Tensor:
        """Bring image, features and extras to the working resolution and join them, (B, C, h, w).

        Args:
            inputs: the left image (B, 3, H, W) in 0..1 first; then maps of full or half resolution.
        """
        height, width = inputs[0].shape[-2:]
        if self.config.half_resolution:
            height, width = max(height // 2, 1), max(width // 2, 1)
        return torch.cat([_resized(x, height, width) for x in inputs], dim=1)

    def standardize(self, mean: Tensor, std: Tensor) -> None:
        """Set the fixed statistics of `joined_input`'s channels, measured once on the training set.

        The matching features mix activations with a disparity in pixels, so they need it; fixed numbers, not a
        normalisation layer, so that a unit of disparity means the same in every batch.
        """
        self.input_mean.copy_(mean)
        self.input_std.copy_(std.clamp(min=1e-3))

    def forward(self, *inputs: Tensor) -> Tensor:
        joined = self.joined_input(*inputs)
        output: Tensor = self.layers(
            (joined - self.input_mean[:, None, None]) / self.input_std[:, None, None]
        )
        return _resized(output.float(), *inputs[0].shape[-2:])


def _activation(name: Activation) -> nn.Module:
    return nn.ReLU(inplace=True) if name == "relu" else nn.LeakyReLU(LEAKY_SLOPE, inplace=True)


def _resized(maps: Tensor, height: int, width: int) -> Tensor:
    if maps.shape[-2:] == (height, width):
        return maps
    if maps.shape[-2] == 2 * height and maps.shape[-1] == 2 * width:
        return F.avg_pool2d(maps, 2)  # the same means, and in ONNX too
    if maps.shape[-2] > height:
        return F.interpolate(maps, size=(height, width), mode="area")
    return F.interpolate(maps, size=(height, width), mode="bilinear", align_corners=False)

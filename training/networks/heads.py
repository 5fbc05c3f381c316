"""What ConfNet and GradNet share: a small fully convolutional network on the image and matching features."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.networks.initialization import initialize
from training.networks.regressors.dispnet import LEAKY_SLOPE, Normalization
from training.networks.regressors.interface import FeatureKind, Regressor

Activation = Literal["relu", "leaky_relu"]
"""After every convolution but the last: ReLU in ConfNet, LeakyReLU in GradNet (the paper)."""


@dataclass(frozen=True)
class HeadConfig:
    """Options of ConfNet and GradNet.

    The defaults are the full networks. The paper gives neither widths nor dropout, so those are ours.

    Examples:
        >>> from training.networks.regressors.dispnet import DispNetConfig, DispNetCorr1D
        >>> regressor = DispNetCorr1D(DispNetConfig(width=0.25))
        >>> HeadConfig(half_resolution=True).on(regressor).feature_channels
        25
    """

    feature_channels: int = 97
    """Channels of the regressor's matching features."""
    width: int = 64
    """Channels of the four 3x3 convolutions (ours)."""
    hidden: int = 128
    """Channels of the 1x1 convolution that takes the place of a fully connected layer (ours)."""
    dropout: float = 0.5
    """Share of the hidden activations dropped in training (ours)."""
    normalization: Normalization = "none"
    """`batch` puts BatchNorm after the 3x3 convolutions (ours)."""
    half_resolution: bool = False
    """Work at the matching features' resolution and upsample the outputs bilinearly, at a quarter of the cost (ours).
    The outputs keep their units: probabilities, and pixels per full-resolution pixel."""
    dilations: tuple[int, int, int, int] = (1, 1, 1, 1)
    """Dilations of the 3x3 convolutions. A regressor's features cover their surroundings already; features made from a
    disparity do not, and need larger ones (ours)."""
    cost_features: bool = False
    """Take the maps of `training.networks.cost_features` as inputs too (ours)."""
    features: FeatureKind = "joined"
    """Which matching features of the regressor: `joined`, as the paper words it (97 channels in DispNetCorr1D at full
    width), or `decoded` (32 channels)."""

    def on(self, regressor: Regressor) -> HeadConfig:
        """The same config with the number of channels of this regressor's features."""
        return replace(self, feature_channels=regressor.feature_channels[self.features])


class PixelHead(nn.Module):
    """Four 3x3 convolutions, a 1x1 convolution as fully connected layer, dropout, and a 1x1 convolution.

    The layers are the paper's, applied to every pixel of the image at once.
    """

    input_mean: Tensor
    """(C,) means of the input channels."""
    input_std: Tensor
    """(C,) standard deviations of the input channels."""

    def __init__(self, config: HeadConfig, extra_channels: int, outputs: int, activation: Activation) -> None:
        """Make the layers with new weights (He initialisation).

        Args:
            config: The network's options.
            extra_channels: Input channels beside the image and the matching features.
            outputs: Output channels.
            activation: After every convolution but the last.
        """
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
        initialize(self.layers, slope)

    def joined_input(self, *inputs: Tensor) -> Tensor:
        """Resize all inputs to the working resolution and concatenate their channels, (B, C, h, w).

        Args:
            inputs: The left image (B, 3, H, W) in 0..1 first; then maps of full or half resolution.
        """
        height, width = inputs[0].shape[-2:]
        if self.config.half_resolution:
            height, width = max(height // 2, 1), max(width // 2, 1)
        return torch.cat([_resized(x, height, width) for x in inputs], dim=1)

    def standardize(self, mean: Tensor, std: Tensor) -> None:
        """Set the fixed statistics by which the channels of `joined_input` are standardised.

        The matching features mix activations with a disparity in pixels, so they need it. The numbers are fixed, unlike
        a normalisation layer's, so that a pixel of disparity means the same in every batch (ours).

        Args:
            mean, std: (C,) of the training set.
        """
        self.input_mean.copy_(mean)
        self.input_std.copy_(std.clamp(min=1e-3))

    def forward(self, *inputs: Tensor) -> Tensor:
        """Outputs (B, outputs, H, W) at the image's resolution, from the inputs of `joined_input`."""
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

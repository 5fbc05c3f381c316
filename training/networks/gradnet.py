"""GradNet: the disparity's forward differences where the surface is smooth (section 3.3 of the paper)."""

from __future__ import annotations

from torch import Tensor

from training.networks.cost_features import COST_FEATURE_CHANNELS, SLOPE_CHANNELS, CostFeatures
from training.networks.heads import HeadConfig, PixelHead

PUBLISHED_GRADNET = HeadConfig(dropout=0.2)
"""The config of the full GradNet. Its dropout is ours, like the widths."""


class GradNet(PixelHead):
    """Forward differences (dx, dy) of the disparity, (B, 2, H, W) in pixels per full-resolution pixel.

    The inputs are the left image, the regressor's matching features and, if the config says so, `cost_feature_maps`
    and `smooth_slopes` (ours).

    Examples:
        >>> import torch
        >>> network = GradNet(HeadConfig(feature_channels=5, width=4, hidden=4)).eval()
        >>> network(torch.rand(2, 3, 32, 64), torch.rand(2, 5, 16, 32)).shape
        torch.Size([2, 2, 32, 64])
    """

    def __init__(self, config: HeadConfig | None = None) -> None:
        """Make the network with new weights; without a config, `PUBLISHED_GRADNET`."""
        config = config or PUBLISHED_GRADNET
        extra_channels = COST_FEATURE_CHANNELS + SLOPE_CHANNELS if config.cost_features else 0
        super().__init__(config, extra_channels, outputs=2, activation="leaky_relu")

    def inputs(self, features: Tensor, cost_features: CostFeatures) -> tuple[Tensor, ...]:
        """Collect what `forward` takes.

        Args:
            features: (B, F, h, w) matching features, of full or half resolution.
            cost_features: The pair and its disparity.
        """
        published = cost_features.left, features
        if not self.config.cost_features:
            return published
        return (*published, cost_features.maps, cost_features.slopes)

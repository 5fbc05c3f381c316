"""ConfNet: the probability that each pixel's disparity is correct (section 3.2 of the paper)."""

from __future__ import annotations

import torch
from torch import Tensor

from training.networks.cost_features import COST_FEATURE_CHANNELS, CostFeatures
from training.networks.heads import HeadConfig, PixelHead

LRC_CEILING_PX = 20.0
"""Left-right differences are clipped here, in pixels (ours)."""


class ConfNet(PixelHead):
    """Logits of (wrong, correct) for each pixel of a disparity map.

    The inputs are the left image, the regressor's matching features, the left-right-consistency map (eq. 1) and, if
    the config says so, `cost_feature_maps` (ours). The paper gives the layers' kinds and kernels; their widths are ours
    (`HeadConfig`).

    Examples:
        >>> network = ConfNet(HeadConfig(feature_channels=5, width=4, hidden=4)).eval()
        >>> image, features = torch.rand(2, 3, 32, 64), torch.rand(2, 5, 16, 32)
        >>> consistency = torch.rand(2, 1, 32, 64)
        >>> network(image, features, consistency).shape
        torch.Size([2, 2, 32, 64])
    """

    def __init__(self, config: HeadConfig | None = None) -> None:
        """Make the network with new weights; without a config, the paper's."""
        config = config or HeadConfig()
        extra_channels = 1 + (COST_FEATURE_CHANNELS if config.cost_features else 0)
        super().__init__(config, extra_channels, outputs=2, activation="relu")

    def inputs(
        self, features: Tensor, consistency: Tensor, cost_features: CostFeatures
    ) -> tuple[Tensor, ...]:
        """Collect what `forward` takes.

        Args:
            features: (B, F, h, w) matching features, of full or half resolution.
            consistency: (B, 1, H, W) px from `left_right_consistency`, -1 where the match leaves the image.
            cost_features: The pair and its disparity.
        """
        published = cost_features.left, features, consistency
        return (*published, cost_features.maps) if self.config.cost_features else published

    def joined_input(self, *inputs: Tensor) -> Tensor:
        """As `PixelHead.joined_input`, with the left-right consistency clipped and scaled to at most 1."""
        image, features, consistency, *cost_features = inputs
        limited = consistency.clamp(max=LRC_CEILING_PX) / LRC_CEILING_PX
        return super().joined_input(image, features, limited, *cost_features)

    def confidence(self, *inputs: Tensor) -> Tensor:
        """P(correct) as (B, 1, H, W) in 0..1, from the same inputs as `forward`."""
        return torch.softmax(self(*inputs), dim=1)[:, 1:]

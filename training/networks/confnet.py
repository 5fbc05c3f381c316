"""ConfNet: how likely each pixel of the regressor's disparity is right (section 3.2 of the paper)."""

from __future__ import annotations

import torch
from torch import Tensor

from training.networks.heads import HeadConfig, PixelHead

LRC_CEILING_PX = 20.0
"""Left-right differences above this tell no more than this does (ours)."""


class ConfNet(PixelHead):
    """Left image, matching features and left-right-consistency map to logits of (wrong, correct)."""

    def __init__(self, config: HeadConfig | None = None) -> None:
        super().__init__(config or HeadConfig(), extra_channels=1, outputs=2, activation="relu")

    def joined_input(self, *inputs: Tensor) -> Tensor:
        image, features, consistency = inputs
        return super().joined_input(image, features, consistency.clamp(max=LRC_CEILING_PX) / LRC_CEILING_PX)

    def confidence(self, *inputs: Tensor) -> Tensor:
        """P(correct), (B, 1, H, W), from the same inputs as `forward`."""
        return torch.softmax(self(*inputs), dim=1)[:, 1:]

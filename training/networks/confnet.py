"""ConfNet: how likely each pixel of the regressor's disparity is right (section 3.2 of the paper)."""

from __future__ import annotations

import torch
from torch import Tensor

from training.networks.cost_features import EVIDENCE_CHANNELS, Evidence
from training.networks.heads import HeadConfig, PixelHead

LRC_CEILING_PX = 20.0
"""Left-right differences above this tell no more than this does (ours)."""


class ConfNet(PixelHead):
    """Left image, matching features, left-right-consistency map, and `disparity_evidence` if so configured, to logits
    of (wrong, correct)."""

    def __init__(self, config: HeadConfig | None = None) -> None:
        config = config or HeadConfig()
        extra_channels = 1 + (EVIDENCE_CHANNELS if config.evidence else 0)
        super().__init__(config, extra_channels, outputs=2, activation="relu")

    def inputs(self, features: Tensor, consistency: Tensor, evidence: Evidence) -> tuple[Tensor, ...]:
        """What `forward` takes, of a pair and what a predictor says about it."""
        published = evidence.left, features, consistency
        return (*published, evidence.maps) if self.config.evidence else published

    def joined_input(self, *inputs: Tensor) -> Tensor:
        image, features, consistency, *evidence = inputs
        limited = consistency.clamp(max=LRC_CEILING_PX) / LRC_CEILING_PX
        return super().joined_input(image, features, limited, *evidence)

    def confidence(self, *inputs: Tensor) -> Tensor:
        """P(correct), (B, 1, H, W), from the same inputs as `forward`."""
        return torch.softmax(self(*inputs), dim=1)[:, 1:]

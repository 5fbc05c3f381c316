"""GradNet: the disparity's forward differences where the surface is smooth (section 3.3 of the paper)."""

from __future__ import annotations

from torch import Tensor

from training.networks.cost_features import EVIDENCE_CHANNELS, SLOPE_CHANNELS, Evidence
from training.networks.heads import HeadConfig, PixelHead

PUBLISHED_GRADNET = HeadConfig(dropout=0.2)


class GradNet(PixelHead):
    """Left image and matching features, and if so configured `disparity_evidence` and `smooth_slopes`, to (dx, dy),
    (B, 2, H, W), in pixels per full-resolution pixel."""

    def __init__(self, config: HeadConfig | None = None) -> None:
        config = config or PUBLISHED_GRADNET
        extra_channels = EVIDENCE_CHANNELS + SLOPE_CHANNELS if config.evidence else 0
        super().__init__(config, extra_channels, outputs=2, activation="leaky_relu")

    def inputs(self, features: Tensor, evidence: Evidence) -> tuple[Tensor, ...]:
        """What `forward` takes, of a pair and what a predictor says about it."""
        published = evidence.left, features
        return (*published, evidence.maps, evidence.slopes) if self.config.evidence else published

"""GradNet: the disparity's forward differences where the surface is smooth (section 3.3 of the paper)."""

from __future__ import annotations

from torch import Tensor

from training.networks.evidence import (
    EVIDENCE_CHANNELS,
    SLOPE_CHANNELS,
    disparity_evidence,
    smooth_slopes,
)
from training.networks.heads import HeadConfig, PixelHead

PUBLISHED_GRADNET = HeadConfig(dropout=0.2)


class GradNet(PixelHead):
    """Left image and matching features, and if so configured `disparity_evidence` and `smooth_slopes`, to (dx, dy),
    (B, 2, H, W), in pixels per full-resolution pixel."""

    def __init__(self, config: HeadConfig | None = None) -> None:
        config = config or PUBLISHED_GRADNET
        extra_channels = EVIDENCE_CHANNELS + SLOPE_CHANNELS if config.evidence else 0
        super().__init__(config, extra_channels, outputs=2, activation="leaky_relu")

    def inputs(self, left: Tensor, right: Tensor, features: Tensor, disparity: Tensor) -> tuple[Tensor, ...]:
        """What `forward` takes, of a pair (B, 3, H, W) in 0..1 and what a predictor says about it."""
        if not self.config.evidence:
            return left, features
        return left, features, disparity_evidence(left, right, disparity), smooth_slopes(disparity)

"""GradNet: the disparity's forward differences where the surface is smooth (section 3.3 of the paper)."""

from __future__ import annotations

from training.networks.heads import HeadConfig, PixelHead

PUBLISHED_GRADNET = HeadConfig(dropout=0.2)


class GradNet(PixelHead):
    """Left image and matching features to (dx, dy), (B, 2, H, W), in pixels per full-resolution pixel."""

    def __init__(self, config: HeadConfig | None = None) -> None:
        config = config or PUBLISHED_GRADNET
        if config.evidence:
            raise ValueError("only ConfNet takes evidence about the disparity")
        super().__init__(config, extra_channels=0, outputs=2, activation="leaky_relu")

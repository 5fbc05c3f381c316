"""GradNet: the disparity's forward differences where the surface is smooth (section 3.3 of the paper)."""

from __future__ import annotations

from training.networks.heads import HeadConfig, PixelHead

PUBLISHED_GRADNET = HeadConfig(dropout=0.2)


class GradNet(PixelHead):
    """Left image and matching features to (dx, dy), (B, 2, H, W), in pixels per full-resolution pixel."""

    def __init__(self, config: HeadConfig | None = None) -> None:
        super().__init__(config or PUBLISHED_GRADNET, extra_channels=0, outputs=2, activation="leaky_relu")

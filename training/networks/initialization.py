"""How the weights of new networks are drawn."""

from __future__ import annotations

from torch import nn

_CONVOLUTIONS = (nn.Conv2d, nn.Conv3d, nn.ConvTranspose2d)


def initialize(network: nn.Module, slope: float = 0.0) -> None:
    """Draw the weights of all convolutions after He et al. (ICCV 2015): normal, variance 2 / fan-in; biases 0.

    Args:
        network: Whose weights are set, in place. Those on the meta device, which are about to be read from a file,
            stay: to draw them, torch would load its compiler, for seconds.
        slope: Of the LeakyReLU that follows, below zero; 0 is a ReLU.

    Examples:
        >>> layer = nn.Conv2d(32, 512, 3)
        >>> initialize(layer)
        >>> round(layer.weight.var().item() * 32 * 9, 1), layer.bias.abs().max().item()
        (2.0, 0.0)
    """
    for layer in network.modules():
        if isinstance(layer, _CONVOLUTIONS) and not layer.weight.is_meta:
            nn.init.kaiming_normal_(layer.weight, a=slope)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)

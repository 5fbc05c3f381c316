"""The 1-D correlation layer of DispNetCorr1D (Mayer et al., CVPR 2016)."""

from __future__ import annotations

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn


def correlate_1d(left: Tensor, right: Tensor, max_displacement: int = 40, one_sided: bool = False) -> Tensor:
    """Correlate two feature maps along their rows.

    c[k](y, x) = mean over channels of left(y, x) * right(y, x + k - max_displacement), where `right` is zero outside
    the image. A point with disparity d (in pixels of the feature map) has its peak in channel max_displacement - d.

    The products of all displacements are one matrix product per row and tile: a tile of T left columns times the
    T + K - 1 right columns that it can reach. The wanted band of that product is read off by skewing its rows (padding
    each by one element and reshaping). So forward and backward passes are matrix products and copies: about ten times
    faster on a CPU than K shifted elementwise products, with memory linear in the width.

    Args:
        left, right: (B, C, H, W).
        max_displacement: Largest displacement in pixels of the feature map.
        one_sided: Only the channels k = 0 .. max_displacement. Disparities are not negative, so the others never match
            (ours).

    Returns:
        (B, K, H, W) with K = 2 * max_displacement + 1, or max_displacement + 1 when one-sided.

    Raises:
        ValueError: the feature maps differ in shape or are not 4-dimensional.

    Examples:
        >>> right = torch.rand(1, 8, 2, 10)
        >>> left = right.roll(3, dims=-1)  # every point moves by 3 px: its disparity
        >>> correlate_1d(left, right, max_displacement=4).shape
        torch.Size([1, 9, 2, 10])
        >>> products = (left * right.roll(3, dims=-1)).mean(dim=1)
        >>> torch.allclose(correlate_1d(left, right, 4)[:, 4 - 3, :, 3:], products[..., 3:])
        True
    """
    if left.shape != right.shape or left.dim() != 4:
        raise ValueError(
            f"correlation needs two (B, C, H, W) maps of one shape, got {tuple(left.shape)} "
            f"and {tuple(right.shape)}"
        )
    batch, channels, height, width = left.shape
    count = displacement_count(max_displacement, one_sided)
    tile = min(count, width)
    tiles = -(-width // tile)
    filler = tiles * tile - width
    reach = tile + count - 1

    columns = F.pad(left, (0, filler)).permute(0, 2, 3, 1).reshape(batch, height, tiles, tile, channels)
    padded = F.pad(right, (max_displacement, count - 1 - max_displacement + filler))
    windows = padded.unfold(-1, reach, tile).permute(0, 2, 3, 1, 4)
    products = torch.matmul(columns, windows) / channels

    skewed = F.pad(products.flatten(3), (0, tile)).view(batch, height, tiles, tile, tile + count)
    band = skewed[..., :count].reshape(batch, height, tiles * tile, count)[:, :, :width]
    return band.permute(0, 3, 1, 2)


def displacement_count(max_displacement: int, one_sided: bool) -> int:
    """Number of the correlation's channels."""
    return max_displacement + 1 if one_sided else 2 * max_displacement + 1


class Correlation1D(nn.Module):
    """`correlate_1d` as a layer.

    Examples:
        >>> layer = Correlation1D(max_displacement=4, one_sided=True)
        >>> layer(torch.rand(1, 8, 2, 10), torch.rand(1, 8, 2, 10)).shape
        torch.Size([1, 5, 2, 10])
    """

    def __init__(self, max_displacement: int = 40, one_sided: bool = False) -> None:
        super().__init__()
        self.max_displacement = max_displacement
        self.one_sided = one_sided

    @property
    def out_channels(self) -> int:
        """Number of channels of the output."""
        return displacement_count(self.max_displacement, self.one_sided)

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        """Correlate two feature maps (B, C, H, W) to (B, K, H, W), K = `out_channels`."""
        return correlate_1d(left, right, self.max_displacement, self.one_sided)


class ShiftedCorrelation1D(nn.Module):
    """`Correlation1D` as shifted products: slower, but with the same graph for any image size."""

    def __init__(self, correlation: Correlation1D) -> None:
        super().__init__()
        self.reach = correlation.max_displacement
        self.count = correlation.out_channels

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        """As `Correlation1D.forward`."""
        padded = F.pad(right, (self.reach, self.count - 1 - self.reach))
        width = left.shape[-1]
        products = [(left * padded[..., shift : shift + width]).mean(dim=1) for shift in range(self.count)]
        return torch.stack(products, dim=1)

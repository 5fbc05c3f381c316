"""The 1-D correlation layer of DispNetCorr1D (Mayer et al., CVPR 2016)."""

from __future__ import annotations

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn


def correlate_1d(left: Tensor, right: Tensor, max_displacement: int = 40, one_sided: bool = False) -> Tensor:
    """Correlate two feature maps along their rows.

    c[k](y, x) = mean over channels of left(y, x) * right(y, x + k - max_displacement), zero outside the image.
    A point with disparity d (in pixels of the feature map) answers in channel max_displacement - d.

    The products of all displacements are one matrix product a row and tile: a tile of T left columns against
    the T + K - 1 right columns it can reach. The wanted band of that product is read off by skewing its rows
    (padding each by one element and reshaping), so forward and backward are GEMMs and copies, about ten times
    faster on a CPU than K shifted elementwise products, and memory stays linear in the width.

    Args:
        left, right: (B, C, H, W).
        max_displacement: reach in pixels of the feature map.
        one_sided: only k = 0 .. max_displacement: disparities are not negative, so the rest never matches.

    Returns:
        (B, K, H, W) with K = 2 * max_displacement + 1, or max_displacement + 1 when one-sided.

    Raises:
        ValueError: the feature maps differ in shape or are not 4-dimensional.
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
    """Channels of the correlation."""
    return max_displacement + 1 if one_sided else 2 * max_displacement + 1


class Correlation1D(nn.Module):
    """`correlate_1d` as a layer."""

    def __init__(self, max_displacement: int = 40, one_sided: bool = False) -> None:
        super().__init__()
        self.max_displacement = max_displacement
        self.one_sided = one_sided

    @property
    def out_channels(self) -> int:
        return displacement_count(self.max_displacement, self.one_sided)

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        return correlate_1d(left, right, self.max_displacement, self.one_sided)

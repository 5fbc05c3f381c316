"""Cost features: what the pair and the disparity itself say for and against each pixel's disparity (ours)."""

from __future__ import annotations

from functools import cached_property

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

COST_OFFSETS_PX = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0)
"""Matching costs are taken at these distances from the disparity; a correct one has its least cost at 0."""
COST_CEILING = 0.25
"""Colour differences (in 0..1) are clipped here."""
SLOPE_CEILING_PX = 4.0
"""Differences between neighbours are clipped here; larger ones are edges."""
RESIDUAL_WINDOWS_PX = (5, 9, 17, 33)
"""Widths of the square windows whose mean disparity a pixel's is compared with."""
RESIDUAL_CEILING_PX = 8.0
"""Distances to such a mean are clipped here."""
LEFT_BORDER_CAP_PX = 160.0
"""Column numbers are clipped here; further to the right every disparity of interest has its match inside the image."""

COST_FEATURE_CHANNELS = len(COST_OFFSETS_PX) + 2 + 2 * len(RESIDUAL_WINDOWS_PX) + 2
"""Channels of `cost_feature_maps`."""

SMOOTH_WITHIN_PX = 2.0
"""A pixel with a larger forward difference lies on an edge and says nothing about its surface's slope."""
SLOPE_WINDOWS_PX = (5, 9, 17, 33, 65)
"""Widths of the square windows over which slopes are averaged."""
SLOPE_CHANNELS = 2 * len(SLOPE_WINDOWS_PX)
"""Channels of `smooth_slopes`."""


class CostFeatures:
    """A pair and a disparity of its left view, with the maps made from them.

    Each map is computed when a network asks for it, and only once.

    Examples:
        >>> left, right = torch.rand(2, 1, 3, 8, 12)
        >>> features = CostFeatures(left, right, torch.ones(1, 1, 8, 12))
        >>> features.maps.shape, features.slopes.shape
        (torch.Size([1, 21, 8, 12]), torch.Size([1, 10, 8, 12]))
    """

    def __init__(self, left: Tensor, right: Tensor, disparity: Tensor) -> None:
        """Keep the inputs.

        Args:
            left, right: (B, 3, H, W) in 0..1.
            disparity: (B, 1, H, W) px, finite.
        """
        self.left, self.right, self.disparity = left, right, disparity

    @cached_property
    def maps(self) -> Tensor:
        """`cost_feature_maps`, (B, `COST_FEATURE_CHANNELS`, H, W)."""
        return cost_feature_maps(self.left, self.right, self.disparity)

    @cached_property
    def slopes(self) -> Tensor:
        """`smooth_slopes`, (B, `SLOPE_CHANNELS`, H, W) px per px."""
        return smooth_slopes(self.disparity)


def cost_feature_maps(left: Tensor, right: Tensor, disparity: Tensor) -> Tensor:
    """Maps that tell correct disparities from wrong ones.

    In this order: `matching_costs`, `limited_slopes`, for each of `RESIDUAL_WINDOWS_PX` the distance to the window's
    mean disparity and the mean absolute distance in the window, and the columns of the pixel and of its match.

    Args:
        left, right: (B, 3, H, W) in 0..1.
        disparity: (B, 1, H, W) px of the left view, finite.

    Returns:
        (B, `COST_FEATURE_CHANNELS`, H, W), all bounded.
    """
    columns = torch.arange(disparity.shape[-1], device=disparity.device, dtype=disparity.dtype)
    places = torch.cat([columns.expand_as(disparity), columns - disparity], dim=1)
    return torch.cat(
        [
            matching_costs(left, right, disparity),
            limited_slopes(disparity),
            *_surroundings(disparity),
            places.clamp(-LEFT_BORDER_CAP_PX, LEFT_BORDER_CAP_PX),
        ],
        dim=1,
    )


def matching_costs(left: Tensor, right: Tensor, disparity: Tensor) -> Tensor:
    """Mean absolute colour difference to the right view, at the disparity plus each of `COST_OFFSETS_PX`.

    The right view is interpolated linearly along its rows; its border columns are repeated outside the image. Arguments
    as for `cost_feature_maps`.

    Returns:
        (B, 9, H, W) in 0..`COST_CEILING`.

    Examples:
        >>> right = torch.rand(1, 3, 4, 20)
        >>> costs = matching_costs(right.roll(2, dims=-1), right, torch.full((1, 1, 4, 20), 2.0))
        >>> costs[0, :, :, 8:-4].mean((1, 2)).argmin().item() == COST_OFFSETS_PX.index(0.0)
        True
    """
    width = left.shape[-1]
    columns = torch.arange(width, device=left.device, dtype=disparity.dtype)
    costs = []
    for offset in COST_OFFSETS_PX:
        match = (columns - disparity - offset).clamp(0, width - 1)
        before = match.floor()
        weight = match - before
        index = before.long().expand_as(right)
        after = (index + 1).clamp(max=width - 1)
        value = right.gather(-1, index) * (1 - weight) + right.gather(-1, after) * weight
        costs.append((left - value).abs().mean(dim=1, keepdim=True))
    return torch.cat(costs, dim=1).clamp(max=COST_CEILING)


def smooth_slopes(disparity: Tensor) -> Tensor:
    """Mean forward differences of the smooth pixels in windows around each pixel.

    They are the slope of a surface without the edges between surfaces.

    Args:
        disparity: (B, 1, H, W) px, finite.

    Returns:
        (B, `SLOPE_CHANNELS`, H, W) px per px: dx and dy of each of `SLOPE_WINDOWS_PX`, 0 where a window holds no smooth
        pixel.

    Examples:
        >>> ramp = 0.5 * torch.arange(12.0).expand(1, 1, 8, 12)
        >>> smooth_slopes(ramp)[0, :2, 4, 4]  # dx and dy of the smallest window
        tensor([0.5000, 0.0000])
    """
    slopes = _differences(disparity)
    smooth = (slopes.abs() <= SMOOTH_WITHIN_PX).all(dim=1, keepdim=True).to(slopes.dtype)
    maps = torch.cat([slopes * smooth, smooth], dim=1)
    means = box_means(maps, SLOPE_WINDOWS_PX)
    return torch.cat([mean[:, :2] / mean[:, 2:].clamp(min=1e-6) for mean in means], dim=1)


def limited_slopes(disparity: Tensor) -> Tensor:
    """Forward differences [dx, dy] of a disparity (B, 1, H, W), clipped at `SLOPE_CEILING_PX`.

    Returns:
        (B, 2, H, W) px per px; dx is 0 in the last column, dy in the last row.
    """
    return _differences(disparity).clamp(-SLOPE_CEILING_PX, SLOPE_CEILING_PX)


def _differences(disparity: Tensor) -> Tensor:
    """Forward differences [dx, dy], (B, 2, H, W), 0 in the last column or row."""
    along_x = F.pad(disparity[..., :, 1:] - disparity[..., :, :-1], (0, 1, 0, 0))
    along_y = F.pad(disparity[..., 1:, :] - disparity[..., :-1, :], (0, 0, 0, 1))
    return torch.cat([along_x, along_y], dim=1)


def _surroundings(disparity: Tensor) -> list[Tensor]:
    """For each window, the signed distance to its mean and the mean absolute distance in it."""
    maps = []
    for window, mean in zip(RESIDUAL_WINDOWS_PX, box_means(disparity, RESIDUAL_WINDOWS_PX), strict=True):
        residual = (disparity - mean).clamp(-RESIDUAL_CEILING_PX, RESIDUAL_CEILING_PX)
        maps += [residual, *box_means(residual.abs(), (window,))]
    return maps


def box_means(maps: Tensor, windows: tuple[int, ...]) -> list[Tensor]:
    """Means over square windows around each pixel; at the borders, over the part of the window inside the image.

    By summed-area tables (Crow 1984), so the cost does not grow with the windows. The sums are float64, since
    differences of large sums lose digits.

    Args:
        maps: (B, C, H, W).
        windows: Widths in pixels, odd.

    Returns:
        For each window, (B, C, H, W) in the maps' type.

    Examples:
        >>> box_means(torch.arange(5.0).view(1, 1, 1, 5), (3,))[0].flatten().tolist()
        [0.5, 1.0, 2.0, 3.0, 3.5]
    """
    sums = F.pad(maps.double().cumsum(-1).cumsum(-2), (1, 0, 1, 0))
    ones = [torch.ones(size, dtype=torch.float64, device=maps.device) for size in maps.shape[-2:]]
    means = []
    for window in windows:
        rows, columns = (_differences_across(F.pad(one.cumsum(0), (1, 0))[None], window)[0] for one in ones)
        inside = _differences_across(_differences_across(sums, window).transpose(-1, -2), window)
        means.append((inside.transpose(-1, -2) / (rows[:, None] * columns)).to(maps.dtype))
    return means


def _differences_across(sums: Tensor, window: int) -> Tensor:
    """Sums over windows along the last axis, (..., N), from cumulative sums (..., N + 1) that begin with 0."""
    reach = window // 2
    last = sums[..., -1:].expand(*sums.shape[:-1], reach)
    padded = torch.cat([F.pad(sums, (reach, 0)), last], dim=-1)
    return padded[..., window:] - padded[..., :-window]

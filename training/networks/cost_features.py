"""What speaks for and against a disparity, from the pair and the disparity itself (ours)."""

from __future__ import annotations

from functools import cached_property

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

COST_OFFSETS_PX = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0)
"""Matching costs are taken this far from the disparity: a right one has its least cost in the middle."""
COST_CEILING = 0.25
"""Larger differences of colour (of 0..1) tell no more than this does."""
SLOPE_CEILING_PX = 4.0
"""Larger differences between neighbours are edges and tell no more than this does."""
RESIDUAL_WINDOWS_PX = (5, 9, 17, 33)
RESIDUAL_CEILING_PX = 8.0
LEFT_BORDER_CAP_PX = 160.0
"""Columns count up to here, beyond which every disparity of interest has its match inside."""

EVIDENCE_CHANNELS = len(COST_OFFSETS_PX) + 2 + 2 * len(RESIDUAL_WINDOWS_PX) + 2
"""Channels of `disparity_evidence`."""

SMOOTH_WITHIN_PX = 2.0
"""A pixel with a larger forward difference lies on an edge and says nothing of its surface's slope."""
SLOPE_WINDOWS_PX = (5, 9, 17, 33, 65)
SLOPE_CHANNELS = 2 * len(SLOPE_WINDOWS_PX)
"""Channels of `smooth_slopes`."""


class Evidence:
    """What a pair and a disparity of its left view say: worked out when a network asks, once for all that do.

    Args:
        left, right: (B, 3, H, W) in 0..1.
        disparity: (B, 1, H, W) px, finite.
    """

    def __init__(self, left: Tensor, right: Tensor, disparity: Tensor) -> None:
        self.left, self.right, self.disparity = left, right, disparity

    @cached_property
    def maps(self) -> Tensor:
        """`disparity_evidence`."""
        return disparity_evidence(self.left, self.right, self.disparity)

    @cached_property
    def slopes(self) -> Tensor:
        """`smooth_slopes`."""
        return smooth_slopes(self.disparity)


def disparity_evidence(left: Tensor, right: Tensor, disparity: Tensor) -> Tensor:
    """Matching costs around a disparity, its slopes, its distance to its surroundings and their roughness, its place.

    Args:
        left, right: (B, 3, H, W) in 0..1.
        disparity: (B, 1, H, W) px of the left view, finite.

    Returns:
        (B, `EVIDENCE_CHANNELS`, H, W), all bounded.
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
    """Mean absolute colour difference to the right view at the disparity plus each of `COST_OFFSETS_PX`.

    The right view is read bilinearly; beyond its borders it repeats. Arguments as for `disparity_evidence`.

    Returns:
        (B, 9, H, W), at most `COST_CEILING`.
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
    """Mean forward differences of the smooth pixels in windows around each pixel: the slope of a surface, from near and
    far, without the edges between surfaces.

    Args:
        disparity: (B, 1, H, W) px, finite.

    Returns:
        (B, `SLOPE_CHANNELS`, H, W): dx and dy of each of `SLOPE_WINDOWS_PX`, 0 where a window holds no smooth pixel.
    """
    slopes = _differences(disparity)
    smooth = (slopes.abs() <= SMOOTH_WITHIN_PX).all(dim=1, keepdim=True).to(slopes.dtype)
    maps = torch.cat([slopes * smooth, smooth], dim=1)
    means = box_means(maps, SLOPE_WINDOWS_PX)
    return torch.cat([mean[:, :2] / mean[:, 2:].clamp(min=1e-6) for mean in means], dim=1)


def limited_slopes(disparity: Tensor) -> Tensor:
    """Forward differences [dx, dy] of (B, 1, H, W), within `SLOPE_CEILING_PX`; 0 in the last column and row."""
    return _differences(disparity).clamp(-SLOPE_CEILING_PX, SLOPE_CEILING_PX)


def _differences(disparity: Tensor) -> Tensor:
    """Forward differences [dx, dy], (B, 2, H, W), 0 in the last column or row."""
    along_x = F.pad(disparity[..., :, 1:] - disparity[..., :, :-1], (0, 1, 0, 0))
    along_y = F.pad(disparity[..., 1:, :] - disparity[..., :-1, :], (0, 0, 0, 1))
    return torch.cat([along_x, along_y], dim=1)


def _surroundings(disparity: Tensor) -> list[Tensor]:
    """For each window the signed distance to its mean, and the mean absolute one in it."""
    maps = []
    for window, mean in zip(RESIDUAL_WINDOWS_PX, box_means(disparity, RESIDUAL_WINDOWS_PX), strict=True):
        residual = (disparity - mean).clamp(-RESIDUAL_CEILING_PX, RESIDUAL_CEILING_PX)
        maps += [residual, *box_means(residual.abs(), (window,))]
    return maps


def box_means(maps: Tensor, windows: tuple[int, ...]) -> list[Tensor]:
    """Means over square windows around each pixel, as much of them as lies inside.

    By sums over all that is above and to the left (Crow 1984), in float64 so that differences of large sums keep their
    digits: the cost does not grow with the windows.

    Args:
        maps: (B, C, H, W).
        windows: Odd widths, px.

    Returns:
        For each window (B, C, H, W) in the maps' type.
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
    """Along the last axis, from sums before each place, (..., N + 1): the windows' own sums, (..., N)."""
    reach = window // 2
    last = sums[..., -1:].expand(*sums.shape[:-1], reach)
    padded = torch.cat([F.pad(sums, (reach, 0)), last], dim=-1)
    return padded[..., window:] - padded[..., :-window]

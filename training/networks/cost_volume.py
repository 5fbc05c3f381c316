"""Parts of a network that matches with a cost volume: the volume, its read-out, and upsampling by learnt weights."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

NEIGHBOURS = 9
"""Coarse pixels that `convex_upsample` mixes: those of a 3x3 window."""


def normalized_groups(maps: Tensor, groups: int) -> Tensor:
    """Split channels into groups and give each group of every pixel the length 1.

    Args:
        maps: (B, C, H, W), C a multiple of `groups`.
        groups: Number of groups.

    Returns:
        (B, groups, C / groups, H, W).
    """
    batch, channels, height, width = maps.shape
    grouped = maps.view(batch, groups, channels // groups, height, width)
    return F.normalize(grouped.float(), dim=2, eps=1e-4)


def cosine_volume(left: Tensor, right: Tensor, levels: int) -> Tensor:
    """Products of each left pixel with the right pixels at disparities 0 .. levels - 1.

    v[d](y, x) = sum over channels of left(y, x) * right(y, x - d), and 0 where x - d lies outside the image. All
    products of a row are one matrix product. With the right view mirrored, the products that a left pixel needs lie
    side by side in it, one place further left for each pixel further right: rows of one less number read them all. So
    any number of levels costs little, and the graph is the same for every size.

    Args:
        left, right: (B, G, C, H, W) of `normalized_groups`, so that products are cosines.
        levels: Number of disparities, in pixels of these maps.

    Returns:
        (B, G, H, W, levels).

    Examples:
        >>> right = normalized_groups(torch.randn(1, 8, 2, 10), groups=2)
        >>> left = right.roll(3, dims=-1)  # every point moves by 3 px: its disparity
        >>> cosine_volume(left, right, levels=5)[0, 0, 0, 4:].argmax(-1).tolist()
        [3, 3, 3, 3, 3, 3]
    """
    batch, groups, _, height, width = left.shape
    mirrored = F.pad(right.flip(-1), (0, levels))
    products = torch.matmul(left.permute(0, 1, 3, 4, 2), mirrored.permute(0, 1, 3, 2, 4)).flatten(3)
    skewed, first = (
        width + levels - 1,
        width - 1,
    )  # the row's length, and where the first pixel's products begin
    rows = products[..., first : first + width * skewed].view(batch, groups, height, width, skewed)
    return rows[..., :levels]


def windowed_cosines(left: Tensor, right: Tensor, disparity: Tensor, reach: int) -> Tensor:
    """Products of each left pixel with the right view around a disparity, interpolated along the row.

    Args:
        left, right: (B, G, C, H, W) of `normalized_groups`.
        disparity: (B, 1, H, W) in pixels of these maps.
        reach: Largest offset in pixels.

    Returns:
        (B, G * (2 reach + 1), H, W): for each group, the products at disparity + k for k = -reach .. reach; 0 where the
        match lies outside the image.

    Examples:
        >>> right = normalized_groups(torch.randn(1, 8, 2, 12), groups=1)
        >>> products = windowed_cosines(right.roll(2, dims=-1), right, torch.ones(1, 1, 2, 12), reach=1)
        >>> products[0, :, 0, 5:-2].argmax(0).unique().item()  # the match lies at disparity 1 + 1
        2
    """
    groups, channels, _, width = left.shape[1:]
    columns = torch.arange(width, device=left.device, dtype=disparity.dtype)
    # However far outside the image, all places around a match lie outside it.
    matches = (columns - disparity[:, 0]).clamp(-reach - 2.0, width + reach + 1.0)
    whole = torch.floor(matches)
    weight = (matches - whole)[:, None]
    products = []
    for offset in range(reach + 1, -reach - 1, -1):  # from the farthest right match to the farthest left
        places = whole.long() + offset
        inside = ((places >= 0) & (places < width))[:, None]
        index = places.clamp(0, width - 1)[:, None, None].expand(-1, groups, channels, -1, -1)
        products.append((left * right.gather(-1, index)).sum(2) * inside)
    pairs = zip(products[1:], products[:-1], strict=True)
    return torch.stack([at * (1 - weight) + after * weight for at, after in pairs], dim=2).flatten(1, 2)


def expected_shift(decision: Tensor, reach: int) -> Tensor:
    """The shift that is decided on after `windowed_cosines`: the expectation over its offsets, plus a free shift.

    Args:
        decision: (B, 2 reach + 2, H, W): logits of the offsets -reach .. reach, and the free shift.
        reach: Largest offset in pixels.

    Returns:
        (B, 1, H, W) px.

    Examples:
        >>> decision = torch.tensor([-20.0, -20.0, 20.0, 0.25]).view(1, 4, 1, 1)
        >>> expected_shift(decision, reach=1).item()
        1.25
    """
    offsets = torch.arange(-reach, reach + 1, device=decision.device, dtype=decision.dtype)
    expectation = (decision[:, :-1].softmax(1) * offsets[:, None, None]).sum(1, keepdim=True)
    return expectation + decision[:, -1:]


class Readout(NamedTuple):
    """What a volume of scores says of each pixel."""

    disparity: Tensor
    """(B, 1, H, W) in levels."""
    certainty: Tensor
    """(B, 3, H, W), each in 0..1: probability of the peak and its neighbours, probability of the highest peak outside
    them, and entropy relative to that of a uniform distribution."""


def read_out(scores: Tensor, reach: int) -> Readout:
    """Disparity and certainty of a volume: the expectation in a window around the best level.

    An expectation over all levels would blend the surfaces in front of and behind an edge.

    Args:
        scores: (B, H, W, D), logits of the levels.
        reach: The window holds the best level and as many on either side.

    Examples:
        >>> scores = torch.full((1, 1, 1, 12), -20.0)
        >>> scores[..., 7], scores[..., 8], scores[..., 1] = 2.0, 2.0, 1.0
        >>> readout = read_out(scores, reach=2)
        >>> readout.disparity.item()
        7.5
        >>> [round(value, 2) for value in readout.certainty.flatten().tolist()]
        [0.84, 0.16, 0.41]
    """
    levels = scores.shape[-1]
    best = scores.detach().argmax(-1, keepdim=True)
    places = best + torch.arange(-reach, reach + 1, device=scores.device)
    inside = (places >= 0) & (places < levels)
    index = places.clamp(0, levels - 1)
    window = torch.where(inside, scores.gather(-1, index), -torch.inf)
    disparity = (window.softmax(-1) * index).sum(-1)
    return Readout(disparity[:, None], _certainty(scores.detach(), index, inside))


def _certainty(scores: Tensor, index: Tensor, inside: Tensor) -> Tensor:
    probability = scores.softmax(-1)
    near = torch.where(inside, probability.gather(-1, index), 0.0).sum(-1)
    elsewhere = probability.scatter(-1, index, 0.0).amax(-1)
    entropy = -(probability * probability.clamp(min=1e-9).log()).sum(-1)
    return torch.stack([near, elsewhere, entropy / math.log(scores.shape[-1])], dim=1)


def convex_upsample(coarse: Tensor, weights: Tensor, factor: int) -> Tensor:
    """Upsample a map: each fine pixel is a mean, with weights of its own, of the 3x3 coarse pixels around it.

    After RAFT (Teed and Deng, ECCV 2020). Unlike interpolation it can keep an edge sharp. Values stay as they are.

    Args:
        coarse: (B, 1, h, w).
        weights: (B, 9 factor^2, h, w), logits.
        factor: How many fine pixels there are in a coarse one, each way.

    Returns:
        (B, 1, factor h, factor w).

    Examples:
        >>> convex_upsample(torch.full((1, 1, 2, 3), 7.0), torch.randn(1, 36, 2, 3), 2).round(decimals=4).unique()
        tensor([7.])
    """
    batch, _, height, width = coarse.shape
    shares = weights.view(batch, NEIGHBOURS, factor * factor, height, width).softmax(1)
    padded = F.pad(coarse, (1, 1, 1, 1), mode="replicate")[:, 0]
    neighbours = torch.stack(
        [padded[:, y : y + height, x : x + width] for y in range(3) for x in range(3)], dim=1
    )
    return F.pixel_shuffle((shares * neighbours[:, :, None]).sum(1), factor)

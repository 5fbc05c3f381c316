"""Layers of CostVolumeNet (`training.networks.regressors.costvolume`): what it compares views by, and how it looks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.networks.cost_volume import NEIGHBOURS, expected_shift, normalized_groups, windowed_cosines
from training.networks.regressors.interface import RegressorConfig

LEAKY_SLOPE = 0.1
"""Slope of LeakyReLU below zero."""
CERTAINTY_CHANNELS = 3
"""Channels of the certainty in `Readout`."""


@dataclass(frozen=True)
class CostVolumeConfig(RegressorConfig):
    """Options of the network. The defaults are the preset `small` (640,000 parameters)."""

    stem: int = 16
    """Channels at 1/2."""
    encoder: tuple[int, int, int, int] = (32, 48, 64, 64)
    """Channels at 1/4, 1/8, 1/16 and 1/32."""
    descriptor_groups: int = 4
    """Groups of the descriptor at 1/4, each of which gives one volume of cosines."""
    group_channels: int = 8
    """Channels of a group, at every resolution."""
    aggregation: tuple[int, int, int, int] = (8, 16, 32, 32)
    """Channels of the 3-D convolutions at 1/4, 1/8, 1/16 and 1/32."""
    look_groups: int = 2
    """Groups of the descriptor at 1/2."""
    look_reach: int = 3
    """Half-resolution pixels on either side of the volume's disparity that the second look compares."""
    look_channels: int = 32
    """Channels of the second look."""
    full_reach: int = 2
    """Pixels on either side of the second look's disparity that the third look compares."""
    full_channels: int = 16
    """Channels of the third look."""


class Views(NamedTuple):
    """What both views are compared by; the left ones first in the batch."""

    quarter: Tensor
    """(2B, C, H/4, W/4) descriptors."""
    half: Tensor
    """(2B, C, H/2, W/2) descriptors."""
    context: Tensor
    """(2B, 24, H/2, W/2) features for upsampling and the second look."""
    guides: tuple[Tensor, ...]
    """Features at 1/4, 1/8, 1/16 and 1/32, which gate the volume."""

    def first(self, batch: int) -> Views:
        """Those of the batch's first pairs."""
        quarter, half, context = (first_pairs(maps, batch) for maps in self[:3])
        return Views(quarter, half, context, tuple(first_pairs(maps, batch) for maps in self.guides))


class Descriptors(nn.Module):
    """Features of one view: an encoder to 1/32, a decoder to 1/4, and descriptors at 1/4 and 1/2."""

    CONTEXT = 24
    """Channels of `Views.context`."""

    def __init__(self, config: CostVolumeConfig) -> None:
        super().__init__()
        c2, encoder = config.stem, config.encoder
        c4 = encoder[0]
        self.stem = nn.Sequential(convolved(3, c2, stride=2), convolved(c2, c2))
        self.down = nn.ModuleList(
            nn.Sequential(convolved(above, here, stride=2), Residual(here))
            for above, here in pairwise((c2, *encoder))
        )
        self.up = nn.ModuleList(convolved(below + here, here) for here, below in pairwise(encoder))
        self.describe_quarter = nn.Conv2d(c4, config.descriptor_groups * config.group_channels, 1)
        self.context = convolved(c2 + c4, self.CONTEXT)
        self.describe_half = nn.Conv2d(self.CONTEXT, config.look_groups * config.group_channels, 1)

    def forward(self, views: Tensor) -> Views:
        """Describe views (2B, 3, H, W)."""
        at2 = maps = self.stem(views)
        scales = [maps := down(maps) for down in self.down]
        for scale in reversed(range(len(self.up))):
            scales[scale] = self.up[scale](torch.cat([doubled(scales[scale + 1]), scales[scale]], dim=1))
        context = self.context(torch.cat([at2, doubled(scales[0])], dim=1))
        return Views(self.describe_quarter(scales[0]), self.describe_half(context), context, tuple(scales))


class Aggregation(nn.Module):
    """A 3-D hourglass over rows, columns and levels, gated at each scale by the left view's features."""

    def __init__(self, config: CostVolumeConfig) -> None:
        super().__init__()
        channels = config.aggregation
        self.enter = nn.ModuleList([convolved3d(config.descriptor_groups, channels[0])])
        for above, here in pairwise(channels):
            self.enter.append(nn.Sequential(convolved3d(above, here, stride=2), convolved3d(here, here)))
        self.gate = nn.ModuleList(
            nn.Conv2d(guide, here, 1) for guide, here in zip(config.encoder, channels, strict=True)
        )
        self.narrow = nn.ModuleList(nn.Conv3d(below, here, 1) for here, below in pairwise(channels))
        self.leave = nn.ModuleList(convolved3d(here, here) for here in channels[:-1])
        self.score = nn.Conv3d(channels[0], 1, 1)

    def forward(self, volume: Tensor, guides: list[Tensor]) -> Tensor:
        """Scores (B, h, w, D) of a volume (B, G, h, w, D); h, w and D are multiples of 8.

        Args:
            volume: The cosines.
            guides: The left view's features at 1/4, 1/8, 1/16 and 1/32.
        """
        maps, scales = volume, []
        for enter, gate, guide in zip(self.enter, self.gate, guides, strict=True):
            maps = enter(maps) * torch.sigmoid(gate(guide))[..., None]
            scales.append(maps)
        for scale in reversed(range(len(self.leave))):
            maps = self.leave[scale](scales[scale] + doubled(self.narrow[scale](maps)))
        scores: Tensor = self.score(maps)[:, 0]
        return scores.float()


class LookOutput(NamedTuple):
    """What the second look says, at 1/2 of the resolution."""

    disparity: Tensor
    """(B, 1, h, w) in pixels of this resolution."""
    weights: Tensor
    """(B, 36, h, w), for `convex_upsample` to full resolution."""
    inputs: Tensor
    """(B, F, h, w): what it decided from."""
    features: Tensor
    """(B, F, h, w): its last features."""


class SecondLook(nn.Module):
    """Compares the views at 1/2 around the volume's disparity, where half a pixel can be seen."""

    def __init__(self, config: CostVolumeConfig) -> None:
        super().__init__()
        self.groups, self.reach = config.look_groups, config.look_reach
        offsets = 2 * config.look_reach + 1
        channels = config.look_channels
        self.input_channels = (
            config.look_groups * (offsets + config.group_channels)
            + Descriptors.CONTEXT
            + CERTAINTY_CHANNELS
            + 1
        )
        self.layers = nn.Sequential(
            convolved(self.input_channels, channels),
            Residual(channels),
            convolved(channels, channels, dilation=2),
            Residual(channels),
            convolved(channels, channels, dilation=4),
            Residual(channels),
        )
        self.decide = nn.Conv2d(channels, offsets + 1, 3, 1, 1)
        self.weights = nn.Sequential(convolved(Descriptors.CONTEXT, 32), nn.Conv2d(32, NEIGHBOURS * 4, 1))

    def begin_without_change(self) -> None:
        """Set the weights of the decision to 0, so that the volume's disparity stays as it is."""
        nn.init.zeros_(self.decide.weight)

    def forward(
        self, left: Tensor, right: Tensor, context: Tensor, disparity: Tensor, certainty: Tensor
    ) -> LookOutput:
        """Look again.

        Args:
            left, right: (B, C, h, w) descriptors.
            context: (B, 24, h, w) features of the left view.
            disparity: (B, 1, h, w) of the volume, in pixels of this resolution.
            certainty: (B, 3, h, w) of the volume.
        """
        grouped = [normalized_groups(view, self.groups) for view in (left, right)]
        products = windowed_cosines(grouped[0], grouped[1], disparity, self.reach)
        scaled = disparity / 32  # of the size of the other inputs
        inputs = torch.cat([products, left, context, certainty, scaled], dim=1)
        features = self.layers(inputs)
        decision = self.decide(features).float()
        looked = disparity + expected_shift(decision, self.reach)
        return LookOutput(looked, self.weights(context).float(), inputs, features)


class ThirdLook(nn.Module):
    """Compares the views once more, at full resolution around the second look's disparity."""

    SEES_ROWS = 8
    """Rows above and below a pixel that its shift depends on, an even number."""

    def __init__(self, config: CostVolumeConfig) -> None:
        super().__init__()
        self.reach, channels = config.full_reach, config.full_channels
        offsets = 2 * config.full_reach + 1
        self.narrow = nn.Conv2d(Descriptors.CONTEXT, channels, 1)
        self.stem = convolved(3, channels)
        self.join = convolved(channels, channels)
        self.describe = nn.Conv2d(channels, config.group_channels, 1)
        self.layers = nn.Sequential(
            convolved(offsets + config.group_channels + channels + 1, channels),
            Residual(channels),
            convolved(channels, channels, dilation=2),
        )
        self.decide = nn.Conv2d(channels, offsets + 1, 3, 1, 1)

    def begin_without_change(self) -> None:
        """Set the weights of the decision to 0, so that the second look's disparity stays as it is."""
        nn.init.zeros_(self.decide.weight)

    def in_strips(self, images: Tensor, context: Tensor, disparity: Tensor, rows: int | None) -> Tensor:
        """`forward`, on so many rows at a time and those around them that they see; all at once if None."""
        height = disparity.shape[-2]
        if rows is None or height <= rows:
            shift: Tensor = self(images, context, disparity)
            return shift
        strips = []
        for top in range(0, height, rows):
            first, last = max(top - self.SEES_ROWS, 0), min(top + rows + self.SEES_ROWS, height)
            half = context[:, :, first // 2 : last // 2]
            strip = self(images[:, :, first:last], half, disparity[:, :, first:last])
            strips.append(strip[:, :, top - first : top - first + rows])
        return torch.cat(strips, dim=2)

    def forward(self, images: Tensor, context: Tensor, disparity: Tensor) -> Tensor:
        """What the second look's disparity should be changed by, (B, 1, H, W) px.

        Args:
            images: (2B, 3, H, W), the left ones first, mean 0.
            context: (2B, 24, H/2, W/2) features of both views.
            disparity: (B, 1, H, W) px after the second look.
        """
        features = self.join(self.stem(images) + doubled(self.narrow(context)))
        described = self.describe(features).chunk(2)
        left, right = (normalized_groups(view, 1) for view in described)
        products = windowed_cosines(left, right, disparity, self.reach)
        scaled = disparity / 64  # of the size of the other inputs
        inputs = [products, described[0], features.chunk(2)[0], scaled]
        decision = self.decide(self.layers(torch.cat(inputs, dim=1))).float()
        return expected_shift(decision, self.reach)


class Residual(nn.Module):
    """Two 3x3 convolutions, added to their input.

    Examples:
        >>> Residual(8)(torch.rand(1, 8, 16, 24)).shape
        torch.Size([1, 8, 16, 24])
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = convolved(channels, channels)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels)
        )

    def forward(self, maps: Tensor) -> Tensor:
        """Of the same shape."""
        return F.leaky_relu(maps + self.second(self.first(maps)), LEAKY_SLOPE)


def convolved(in_channels: int, channels: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    """A 3x3 convolution, BatchNorm and LeakyReLU."""
    return nn.Sequential(
        nn.Conv2d(in_channels, channels, 3, stride, dilation, dilation, bias=False),
        nn.BatchNorm2d(channels),
        nn.LeakyReLU(LEAKY_SLOPE, inplace=True),
    )


def convolved3d(in_channels: int, channels: int, stride: int = 1) -> nn.Sequential:
    """A 3x3x3 convolution, BatchNorm and LeakyReLU."""
    return nn.Sequential(
        nn.Conv3d(in_channels, channels, 3, stride, 1, bias=False),
        nn.BatchNorm3d(channels),
        nn.LeakyReLU(LEAKY_SLOPE, inplace=True),
    )


def first_pairs(maps: Tensor, batch: int) -> Tensor:
    """The maps (2N, ...) of left and right views, of the first pairs only, (2 batch, ...)."""
    left, right = maps.chunk(2)
    return torch.cat([left[:batch], right[:batch]])


def doubled(maps: Tensor) -> Tensor:
    """Every pixel, and every level of a volume, twice each way."""
    return F.interpolate(maps, scale_factor=2.0, mode="nearest")

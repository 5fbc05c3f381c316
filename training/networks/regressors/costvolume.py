"""CostVolumeNet: disparity by matching in a cost volume (ours).

After GC-Net (Kendall et al., ICCV 2017), PSMNet (Chang and Chen, CVPR 2018) and GwcNet (Guo et al., CVPR 2019), at a
fraction of their size. Where DispNetCorr1D remembers what worlds look like, a network that compares transfers to
photographs.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.errors import TrainingError
from training.losses import disparity_smooth_l1, level_cross_entropy
from training.networks.cost_volume import (
    NEIGHBOURS,
    convex_upsample,
    cosine_volume,
    expected_shift,
    normalized_groups,
    read_out,
    windowed_cosines,
)
from training.networks.initialization import initialize
from training.networks.regressors.interface import (
    FeatureKind,
    Objective,
    Regression,
    Regressor,
    RegressorConfig,
)

LEAKY_SLOPE = 0.1
"""Slope of LeakyReLU below zero."""
CELL = 4
"""Full-resolution pixels in a pixel of the volume, each way, and in one of its levels."""
CERTAINTY_CHANNELS = 3
"""Channels of the certainty in `Readout`."""
LARGEST_DISPARITY_PX = 192
"""Disparities below this are looked for in images of ordinary size, as the field does."""
LARGEST_ENLARGEMENT = 2.0
"""Of small pictures."""
READOUT_REACH = 2
"""Levels on either side of the best that the read-out's expectation is taken over."""


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


class CostVolumeOutput(NamedTuple):
    """The outputs of one forward pass."""

    scores: Tensor
    """(B, H/4, W/4, D) logits of the disparities 0, 4, 8, ... px."""
    coarse: Tensor
    """(B, 1, H, W) px: the volume's disparity."""
    half: Tensor
    """(B, 1, H, W) px after the second look, at 1/2 of the resolution."""
    disparity: Tensor
    """(B, 1, H, W) px after the third look, at full resolution; not clipped at zero."""
    joined: Tensor
    """(B, F, H/2, W/2): what the second look decides from, the volume's certainty, and as the last channel the
    disparity in pixels."""
    decoded: Tensor
    """(B, F, H/2, W/2): the second look's last features."""


@dataclass(frozen=True)
class CostVolumeObjective(Objective):
    """Smooth L1 of the three disparities, and cross-entropy of the volume."""

    cross_entropy: float = 1.0
    """Weight of the volume's cross-entropy against a Laplacian about the ground truth."""
    spread_levels: float = 0.5
    """Scale of the Laplacian, in levels."""
    coarse_beta_px: float = 1.0
    """Errors of the volume's disparity below this count by their squares."""
    beta_px: float = 0.3
    """Errors of the disparities after the second and the third look below this count by their squares."""
    mendable_px: float = 8.0
    """The looks cannot mend larger errors of the volume; such pixels count with weight `unmendable`."""
    unmendable: float = 0.1
    """Weight of pixels with larger errors."""

    def __call__(self, output: CostVolumeOutput, disparity: Tensor, progress: float) -> Tensor:
        """The loss of a batch. Ground truth beyond the volume's largest level is left out."""
        del progress
        limit = float(CELL * (output.scores.shape[-1] - 1))
        truth = torch.where(disparity <= limit, disparity, torch.nan)
        mendable = (output.coarse.detach() - truth).abs() <= self.mendable_px
        near = torch.where(mendable, truth, torch.nan)
        loss = self.cross_entropy * level_cross_entropy(output.scores, truth / CELL, self.spread_levels)
        loss = loss + disparity_smooth_l1(output.coarse, truth, self.coarse_beta_px)
        for looked in (output.half, output.disparity):
            loss = loss + disparity_smooth_l1(looked, near, self.beta_px)
            loss = loss + self.unmendable * disparity_smooth_l1(looked, truth, self.beta_px)
        return loss


class CostVolumeNet(Regressor):
    """Disparity from a rectified pair: a volume of cosines at 1/4, a second look at 1/2 and a third at full resolution.

    Examples:
        >>> network = CostVolumeNet().eval()
        >>> network.look_up_to(64)
        >>> left, right = torch.rand(2, 1, 3, 32, 96)
        >>> output = network(left, right)
        >>> output.scores.shape, output.disparity.shape
        (torch.Size([1, 8, 24, 16]), torch.Size([1, 1, 32, 96]))
    """

    name = "costvolume"
    title = "CostVolumeNet"
    config_type = CostVolumeConfig
    stride = 32

    max_disparity: int | None = None
    """What `look_up_to` set; None chooses by the images' width (`disparity_range`)."""
    largest_volume_pixels: int | None = 2_100_000
    """Images of more pixels are searched at half their size, so that time and memory stay in bounds; None searches all
    at their own."""
    enlarged_to_pixels: int | None = 1_050_000
    """Pictures are seen enlarged to about so many pixels, by 2 at most, since the network has fewer fine errors then;
    None enlarges none."""
    strip_rows: int | None = 96
    """Rows that the third look takes at a time where nothing is trained, since its maps at full resolution fit the
    processor's cache then; None takes all at once."""

    def __init__(self, config: CostVolumeConfig | None = None) -> None:
        """Make the network with new weights; without a config, that of `small`."""
        self.config: CostVolumeConfig
        config = config or CostVolumeConfig()
        super().__init__(config)
        self.descriptors = Descriptors(config)
        self.aggregation = Aggregation(config)
        self.half_weights = nn.Sequential(_convolved(config.encoder[0], 32), nn.Conv2d(32, NEIGHBOURS * 4, 1))
        self.look = SecondLook(config)
        self.full_look = ThirdLook(config)
        self.feature_channels: dict[FeatureKind, int] = {
            "joined": self.look.input_channels + 1,
            "decoded": config.look_channels,
        }
        self.register_buffer("image_mean", torch.full((3,), 0.4))
        initialize(self, LEAKY_SLOPE)
        self.look.begin_without_change()
        self.full_look.begin_without_change()

    def enlarged_size(self, height: int, width: int) -> tuple[int, int] | None:
        """Small pictures are enlarged, for fine errors, to multiples of 32.

        As they are, the network sees more around a pixel at once, which tells how far away plain walls are.
        """
        if self.enlarged_to_pixels is None or height * width >= self.enlarged_to_pixels:
            return None
        enlargement = min(math.sqrt(self.enlarged_to_pixels / (height * width)), LARGEST_ENLARGEMENT)
        return _whole(height * enlargement, self.stride), _whole(width * enlargement, self.stride)

    def rescaled(self, regression: Regression, factor: float) -> Regression:
        """The last two channels of the joined features are disparities: the volume's and the second look's."""
        joined = regression.features["joined"]
        features = {
            **regression.features,
            "joined": torch.cat([joined[:, :-2], factor * joined[:, -2:]], dim=1),
        }
        return Regression(factor * regression.disparity, features)

    def see(
        self, left: Tensor, right: Tensor, stretch: float, up_to: float | None = None
    ) -> CostVolumeOutput:
        """What `forward` returns for images that were made `stretch` times wider; it looks as far in the pictures."""
        disparity_range: float = self.disparity_range(left.shape[-1] / stretch)
        if up_to is not None:
            disparity_range = min(disparity_range, up_to)
        return self(left, right, _whole(disparity_range * stretch, self.stride))

    def forward(self, left: Tensor, right: Tensor, disparity_range: int | None = None) -> CostVolumeOutput:
        """Predict the left view's disparity.

        Args:
            left, right: (B, 3, H, W) in 0..1, H and W multiples of 32.
            disparity_range: Disparities from 0 to below this many pixels are looked for, a multiple of 32; None looks
                as far as a crop may reach, half of its width, but at most 192 px, or as far as `look_up_to` says.

        Raises:
            ValueError: the images differ in size, or a size is no multiple of 32.
        """
        self.check_images(left, right)
        images = torch.cat([left, right]) - self.image_mean.view(1, 3, 1, 1)
        views = self.descriptors(images)
        matched = self._match(images, views, disparity_range or self._range_of_crops(left.shape[-1]))
        coarse, half = matched.disparity, views.half.chunk(2)
        context = views.context.chunk(2)[0]
        seen = self.look(half[0], half[1], context, coarse.detach(), matched.certainty)
        # Both are upsampled by one set of weights, so that the volume's error trains these from the first step.
        fine = [2 * convex_upsample(each, seen.weights, 2) for each in (coarse, seen.disparity)]
        strip_rows = None if torch.is_grad_enabled() else self.strip_rows
        shift = self.full_look.in_strips(images, views.context, fine[1].detach(), strip_rows)
        joined = torch.cat([seen.inputs, 2 * seen.disparity.detach()], dim=1)
        return CostVolumeOutput(matched.scores, fine[0], fine[1], fine[1] + shift, joined, seen.features)

    def _match(self, images: Tensor, views: Views, disparity_range: int) -> Matched:
        """Search the volume; that of images of more than `largest_volume_pixels` at half their size, and so on.

        Args:
            images: (2B, 3, H, W), the left ones first, mean 0.
            views: What the images are compared by.
            disparity_range: In pixels.
        """
        guides = [maps.chunk(2)[0] for maps in views.guides]
        weights = self.half_weights(guides[0])
        most, (height, width) = self.largest_volume_pixels, images.shape[-2:]
        if most is not None and height * width > most:
            small, size = _halved(images, self.stride)
            below = self._match(small, self.descriptors(small), _whole(disparity_range / 2, self.stride))
            coarse, certainty = (
                maps[..., : size[0], : size[1]] for maps in (below.disparity, below.certainty)
            )
            return Matched(below.scores, convex_upsample(2 * coarse, weights, 2), _doubled(certainty))
        left, right = (
            normalized_groups(view, self.config.descriptor_groups) for view in views.quarter.chunk(2)
        )
        scores = self.aggregation(cosine_volume(left, right, disparity_range // CELL), guides)
        readout = read_out(scores, READOUT_REACH)
        # At 1/2, disparities are counted in pixels of that resolution.
        coarse = convex_upsample(readout.disparity * (CELL / 2), weights, 2)
        return Matched(scores, coarse, _doubled(readout.certainty))

    def look_up_to(self, max_disparity: int) -> None:
        """Look for disparities from 0 to this many pixels. That changes no weights.

        Raises:
            TrainingError: the number is not positive.
        """
        if max_disparity < 1:
            raise TrainingError(f"the largest disparity must be positive, not {max_disparity} px")
        self.max_disparity = max_disparity

    def exportable(self) -> CostVolumeNet:
        """The network with one scale and one disparity range for every image size, 0 to 192 px where none was set."""
        network = copy.copy(self)
        network.max_disparity = self.max_disparity or LARGEST_DISPARITY_PX
        network.largest_volume_pixels = network.strip_rows = None
        return network

    def disparity_range(self, width: float) -> int:
        """Disparities from 0 to below this many pixels are looked for in pictures, a multiple of 32.

        Where nothing was set, it is a quarter of the width, but at least 64 px and at most 192 px or, in wide pictures,
        an eighth of the width.

        Args:
            width: Of the pictures, in pixels.

        Examples:
            >>> CostVolumeNet().disparity_range(450), CostVolumeNet().disparity_range(1242)
            (128, 192)
        """
        if self.max_disparity is not None:  # at every width, also in a graph that is traced
            return _whole(self.max_disparity, self.stride)
        wanted = max(64, min(width / 4, LARGEST_DISPARITY_PX), width / 8)
        return min(_whole(wanted, self.stride), _whole(width, self.stride))

    def _range_of_crops(self, width: int) -> int:
        """How far `forward` looks in images of a width if nothing is said."""
        if self.max_disparity is not None:
            return self.disparity_range(width)
        return max(min(width // 2, LARGEST_DISPARITY_PX) // self.stride * self.stride, self.stride)

    def regression(self, output: CostVolumeOutput) -> Regression:
        """The disparity after the third look, and the second look's features."""
        features: dict[FeatureKind, Tensor] = {"joined": output.joined, "decoded": output.decoded}
        return Regression(F.relu(output.disparity), features)


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


class Descriptors(nn.Module):
    """Features of one view: an encoder to 1/32, a decoder to 1/4, and descriptors at 1/4 and 1/2."""

    CONTEXT = 24
    """Channels of `Views.context`."""

    def __init__(self, config: CostVolumeConfig) -> None:
        super().__init__()
        c2, encoder = config.stem, config.encoder
        c4 = encoder[0]
        self.stem = nn.Sequential(_convolved(3, c2, stride=2), _convolved(c2, c2))
        self.down = nn.ModuleList(
            nn.Sequential(_convolved(above, here, stride=2), Residual(here))
            for above, here in pairwise((c2, *encoder))
        )
        self.up = nn.ModuleList(_convolved(below + here, here) for here, below in pairwise(encoder))
        self.describe_quarter = nn.Conv2d(c4, config.descriptor_groups * config.group_channels, 1)
        self.context = _convolved(c2 + c4, self.CONTEXT)
        self.describe_half = nn.Conv2d(self.CONTEXT, config.look_groups * config.group_channels, 1)

    def forward(self, views: Tensor) -> Views:
        """Describe views (2B, 3, H, W)."""
        at2 = maps = self.stem(views)
        scales = [maps := down(maps) for down in self.down]
        for scale in reversed(range(len(self.up))):
            scales[scale] = self.up[scale](torch.cat([_doubled(scales[scale + 1]), scales[scale]], dim=1))
        context = self.context(torch.cat([at2, _doubled(scales[0])], dim=1))
        return Views(self.describe_quarter(scales[0]), self.describe_half(context), context, tuple(scales))


class Aggregation(nn.Module):
    """A 3-D hourglass over rows, columns and levels, gated at each scale by the left view's features."""

    def __init__(self, config: CostVolumeConfig) -> None:
        super().__init__()
        channels = config.aggregation
        self.enter = nn.ModuleList([_convolved3d(config.descriptor_groups, channels[0])])
        for above, here in pairwise(channels):
            self.enter.append(nn.Sequential(_convolved3d(above, here, stride=2), _convolved3d(here, here)))
        self.gate = nn.ModuleList(
            nn.Conv2d(guide, here, 1) for guide, here in zip(config.encoder, channels, strict=True)
        )
        self.narrow = nn.ModuleList(nn.Conv3d(below, here, 1) for here, below in pairwise(channels))
        self.leave = nn.ModuleList(_convolved3d(here, here) for here in channels[:-1])
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
            maps = self.leave[scale](scales[scale] + _doubled(self.narrow[scale](maps)))
        scores: Tensor = self.score(maps)[:, 0]
        return scores.float()


class Matched(NamedTuple):
    """What the volume says, at 1/2 of the resolution."""

    scores: Tensor
    """(B, h, w, D), as in `CostVolumeOutput`; of a smaller image if the images are wide."""
    disparity: Tensor
    """(B, 1, H/2, W/2) in pixels of this resolution."""
    certainty: Tensor
    """(B, 3, H/2, W/2), as in `Readout`."""


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
            _convolved(self.input_channels, channels),
            Residual(channels),
            _convolved(channels, channels, dilation=2),
            Residual(channels),
            _convolved(channels, channels, dilation=4),
            Residual(channels),
        )
        self.decide = nn.Conv2d(channels, offsets + 1, 3, 1, 1)
        self.weights = nn.Sequential(_convolved(Descriptors.CONTEXT, 32), nn.Conv2d(32, NEIGHBOURS * 4, 1))

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
        self.stem = _convolved(3, channels)
        self.join = _convolved(channels, channels)
        self.describe = nn.Conv2d(channels, config.group_channels, 1)
        self.layers = nn.Sequential(
            _convolved(offsets + config.group_channels + channels + 1, channels),
            Residual(channels),
            _convolved(channels, channels, dilation=2),
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
        features = self.join(self.stem(images) + _doubled(self.narrow(context)))
        described = self.describe(features).chunk(2)
        left, right = (normalized_groups(view, 1) for view in described)
        products = windowed_cosines(left, right, disparity, self.reach)
        scaled = disparity / 64  # of the size of the other inputs
        inputs = [products, described[0], features.chunk(2)[0], scaled]
        decision = self.decide(self.layers(torch.cat(inputs, dim=1))).float()
        return expected_shift(decision, self.reach)


class Residual(nn.Module):
    """Two 3x3 convolutions, added to their input."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _convolved(channels, channels)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels)
        )

    def forward(self, maps: Tensor) -> Tensor:
        """Of the same shape."""
        return F.leaky_relu(maps + self.second(self.first(maps)), LEAKY_SLOPE)


def _convolved(in_channels: int, channels: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    """A 3x3 convolution, BatchNorm and LeakyReLU."""
    return nn.Sequential(
        nn.Conv2d(in_channels, channels, 3, stride, dilation, dilation, bias=False),
        nn.BatchNorm2d(channels),
        nn.LeakyReLU(LEAKY_SLOPE, inplace=True),
    )


def _convolved3d(in_channels: int, channels: int, stride: int = 1) -> nn.Sequential:
    """A 3x3x3 convolution, BatchNorm and LeakyReLU."""
    return nn.Sequential(
        nn.Conv3d(in_channels, channels, 3, stride, 1, bias=False),
        nn.BatchNorm3d(channels),
        nn.LeakyReLU(LEAKY_SLOPE, inplace=True),
    )


def _doubled(maps: Tensor) -> Tensor:
    """Every pixel, and every level of a volume, twice each way."""
    return F.interpolate(maps, scale_factor=2.0, mode="nearest")


def _whole(length: float, unit: int) -> int:
    """The next multiple of a unit."""
    return math.ceil(length / unit) * unit


def _halved(images: Tensor, stride: int) -> tuple[Tensor, tuple[int, int]]:
    """Images (B, C, H, W) at half their size, padded to multiples of a stride, and (H/4, W/4)."""
    height, width = images.shape[-2] // 2, images.shape[-1] // 2
    missing = (0, _whole(width, stride) - width, 0, _whole(height, stride) - height)
    return F.pad(F.avg_pool2d(images, 2), missing, mode="replicate"), (height // 2, width // 2)

"""CostVolumeNet: disparity by matching in a cost volume (ours).

After GC-Net (Kendall et al., ICCV 2017), PSMNet (Chang and Chen, CVPR 2018) and GwcNet (Guo et al., CVPR 2019), at a
fraction of their size. Where DispNetCorr1D remembers what worlds look like, a network that compares transfers to
photographs.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
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
    normalized_groups,
    read_out,
)
from training.networks.cost_volume_layers import (
    LEAKY_SLOPE,
    Aggregation,
    CostVolumeConfig,
    Descriptors,
    SecondLook,
    ThirdLook,
    Views,
    convolved,
    doubled,
    first_pairs,
)
from training.networks.initialization import initialize
from training.networks.regressors.interface import (
    FeatureKind,
    Objective,
    Regression,
    Regressor,
    resize,
    with_mirrored,
)

CELL = 4
"""Full-resolution pixels in a pixel of the volume, each way, and in one of its levels."""
LARGEST_DISPARITY_PX = 192
"""Disparities below this are looked for in images of ordinary size, as the field does."""
LARGEST_ENLARGEMENT = 2.0
"""Of small pictures."""
READOUT_REACH = 2
"""Levels on either side of the best that the read-out's expectation is taken over."""


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
        self.half_weights = nn.Sequential(convolved(config.encoder[0], 32), nn.Conv2d(32, NEIGHBOURS * 4, 1))
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

    def regress(
        self, left: Tensor, right: Tensor, stretch: float | None = None, up_to: float | None = None
    ) -> Regression:
        """As `Regressor.regress`; disparities are looked for as far as `disparity_range` and `up_to` say."""
        return self.regression(self(left, right, self._range_of(left, stretch, up_to)))

    def both(self, left: Tensor, right: Tensor, stretch: float | None = None) -> tuple[Regression, Tensor]:
        """As `Regressor.both`, but the right view's disparity is the volume's, which is fine enough to compare."""
        images, views, matched = self._search(
            *with_mirrored(left, right), self._range_of(left, stretch, None)
        )
        batch = left.shape[0]
        output = self._look(first_pairs(images, batch), views.first(batch), matched.first(batch))
        right_half = 2 * matched.disparity[batch:].flip(-1)
        height, width = left.shape[-2:]
        return self.regression(output), resize(F.relu(right_half), height, width, antialias=False)

    def forward(self, left: Tensor, right: Tensor, disparity_range: int | None = None) -> CostVolumeOutput:
        """Predict the left view's disparity.

        Args:
            left, right: (B, 3, H, W) in 0..1, H and W multiples of 32.
            disparity_range: Disparities from 0 to below this many pixels are looked for, a multiple of 32; None looks
                as far as a crop may reach, half of its width, but at most 192 px, or as far as `look_up_to` says.

        Raises:
            ValueError: the images differ in size, or a size is no multiple of 32.
        """
        return self._look(*self._search(left, right, disparity_range or self._range_of_crops(left.shape[-1])))

    def _search(self, left: Tensor, right: Tensor, disparity_range: int) -> tuple[Tensor, Views, Matched]:
        """Both views, mean 0, what they are compared by, and what the volume says."""
        self.check_images(left, right)
        images = torch.cat([left, right]) - self.image_mean.view(1, 3, 1, 1)
        views = self.descriptors(images)
        return images, views, self._match(images, views, disparity_range)

    def _look(self, images: Tensor, views: Views, matched: Matched) -> CostVolumeOutput:
        """The second and the third look."""
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
            return Matched(below.scores, convex_upsample(2 * coarse, weights, 2), doubled(certainty))
        left, right = (
            normalized_groups(view, self.config.descriptor_groups) for view in views.quarter.chunk(2)
        )
        scores = self.aggregation(cosine_volume(left, right, disparity_range // CELL), guides)
        readout = read_out(scores, READOUT_REACH)
        # At 1/2, disparities are counted in pixels of that resolution.
        coarse = convex_upsample(readout.disparity * (CELL / 2), weights, 2)
        return Matched(scores, coarse, doubled(readout.certainty))

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

    def _range_of(self, left: Tensor, stretch: float | None, up_to: float | None) -> int:
        """How far `regress` looks in images, in their pixels."""
        if stretch is None:
            return self._range_of_crops(left.shape[-1])
        disparity_range: float = self.disparity_range(left.shape[-1] / stretch)
        if up_to is not None:
            disparity_range = min(disparity_range, up_to)
        return _whole(disparity_range * stretch, self.stride)

    def _range_of_crops(self, width: int) -> int:
        """How far `forward` looks in images of a width if nothing is said."""
        if self.max_disparity is not None:
            return self.disparity_range(width)
        return max(min(width // 2, LARGEST_DISPARITY_PX) // self.stride * self.stride, self.stride)

    def regression(self, output: CostVolumeOutput) -> Regression:
        """The disparity after the third look, and the second look's features."""
        features: dict[FeatureKind, Tensor] = {"joined": output.joined, "decoded": output.decoded}
        return Regression(F.relu(output.disparity), features)


class Matched(NamedTuple):
    """What the volume says, at 1/2 of the resolution."""

    scores: Tensor
    """(B, h, w, D), as in `CostVolumeOutput`; of a smaller image if the images are wide."""
    disparity: Tensor
    """(B, 1, H/2, W/2) in pixels of this resolution."""
    certainty: Tensor
    """(B, 3, H/2, W/2), as in `Readout`."""

    def first(self, batch: int) -> Matched:
        """That of the batch's first pairs."""
        return Matched(*(maps[:batch] for maps in self))


def _whole(length: float, unit: int) -> int:
    """The next multiple of a unit."""
    return math.ceil(length / unit) * unit


def _halved(images: Tensor, stride: int) -> tuple[Tensor, tuple[int, int]]:
    """Images (B, C, H, W) at half their size, padded to multiples of a stride, and (H/4, W/4)."""
    height, width = images.shape[-2] // 2, images.shape[-1] // 2
    missing = (0, _whole(width, stride) - width, 0, _whole(height, stride) - height)
    return F.pad(F.avg_pool2d(images, 2), missing, mode="replicate"), (height // 2, width // 2)

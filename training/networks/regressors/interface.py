"""What a regressor is: a network that predicts the left view's disparity from a rectified pair.

A new one is one module in this folder with a `Regressor` subclass; it is found by itself
(`training.networks.regressors.registry`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.errors import TrainingError

FeatureKind = Literal["joined", "decoded"]
"""Which of a regressor's matching features a head takes: `joined`, what its last decision is made from, or `decoded`,
the last layer before the decision."""


class Regression(NamedTuple):
    """A regressor's answer for a batch, at full resolution."""

    disparity: Tensor
    """(B, 1, H, W) px of the input, not negative."""
    features: Mapping[FeatureKind, Tensor]
    """(B, F, h, w) matching features of each kind, of half resolution."""


@dataclass(frozen=True)
class RegressorConfig:
    """Options of a regressor. Subclasses are frozen dataclasses, part of a preset and of the files of weights."""


@dataclass(frozen=True)
class Objective:
    """What a regressor is trained to minimise. Subclasses are frozen dataclasses, part of a preset."""

    stage_ends: tuple[float, ...] = ()
    """Share of the run at which each stage of the objective but the last ends; empty if it does not change."""

    def __call__(self, output: Any, disparity: Tensor, progress: float) -> Tensor:
        """The loss of a batch, a scalar.

        Args:
            output: What the regressor's `forward` returned.
            disparity: (B, 1, H, W) px, NaN invalid.
            progress: Share of the run that is done, from 0.
        """
        raise NotImplementedError


class Regressor(nn.Module, ABC):
    """A network that predicts the left view's disparity."""

    name: ClassVar[str]
    """Its name on the command line and in run folders."""
    title: ClassVar[str]
    """Its name in words."""
    config_type: ClassVar[type[RegressorConfig]]
    """The dataclass of its options, the only argument of the constructor."""
    stride: ClassVar[int]
    """Width and height of the input must be multiples of this."""

    config: RegressorConfig
    """Its options, of `config_type`."""
    feature_channels: dict[FeatureKind, int]
    """Channels of the features of each kind."""
    image_mean: Tensor
    """(3,) mean colour of the training set in 0..1, which is subtracted from both images."""

    def __init__(self, config: Any) -> None:
        """Keep the options."""
        super().__init__()
        self.config = config

    @abstractmethod
    def regression(self, output: Any) -> Regression:
        """The answer in what `forward(left, right)` returned for images (B, 3, H, W) in 0..1."""

    def decayed_parameters(self) -> Iterable[nn.Parameter]:
        """The parameters with weight decay: all of them, unless a network overrides this."""
        return self.parameters()

    def fitting(self, height: int, width: int) -> Fitting:
        """How images of any size are brought to a size that the network takes."""
        return Padding(height, width, self.stride)

    def enlarged_size(self, height: int, width: int) -> tuple[int, int] | None:
        """The (height, width) at which images of a fitting's size are seen a second time, for finer answers.

        None if they are seen once.
        """
        del height, width
        return None

    def rescaled(self, regression: Regression, factor: float) -> Regression:
        """An answer in other pixels: its disparity, and what features hold of it, multiplied by a factor.

        A network that sees images enlarged overrides this, since it knows its features.
        """
        del factor
        return regression

    def regress(
        self, left: Tensor, right: Tensor, stretch: float | None = None, up_to: float | None = None
    ) -> Regression:
        """Predict the left view's disparity, in pixels of the images.

        A network that can look less far overrides this and `both`.

        Args:
            left, right: (B, 3, H, W) in 0..1, H and W multiples of the stride.
            stretch: How many times wider than whole pictures these are, in whose pixels it is counted how far the
                network looks. None for crops, in which `forward` decides.
            up_to: Pixels of the pictures beyond which the network need not look; None if that is not known.

        Examples:
            >>> import torch
            >>> from training.networks import DispNetConfig, DispNetCorr1D
            >>> regressor = DispNetCorr1D(DispNetConfig(width=0.0625)).eval()
            >>> regressor.regress(*torch.rand(2, 1, 3, 64, 64)).disparity.shape
            torch.Size([1, 1, 64, 64])
        """
        del stretch, up_to
        return self.regression(self(left, right))

    def both(self, left: Tensor, right: Tensor, stretch: float | None = None) -> tuple[Regression, Tensor]:
        """Predict the left view's disparity, and the right view's (B, 1, H, W), to compare them.

        The right view's is that of the swapped views, mirrored (`training.networks.lrc.predict_right`), in the same
        batch. Arguments as for `regress`.
        """
        found = self.regress(*with_mirrored(left, right), stretch)
        batch = left.shape[0]
        features = {kind: maps[:batch] for kind, maps in found.features.items()}
        return Regression(found.disparity[:batch], features), found.disparity[batch:].flip(-1)

    def look_up_to(self, max_disparity: int) -> None:
        """Look for disparities from 0 to this many pixels, instead of what the network chooses by itself.

        Raises:
            TrainingError: the network's range cannot be changed, or the number is not positive.
        """
        raise TrainingError(
            f"{self.title} looks as far as it was trained to; a largest disparity of {max_disparity} px cannot be set"
        )

    def exportable(self) -> Regressor:
        """The network in a form whose graph is the same for every image size, for ONNX."""
        return self

    def check_images(self, left: Tensor, right: Tensor) -> None:
        """Check the sizes of the images.

        Raises:
            ValueError: they differ in size, or a size is no multiple of the stride.
        """
        if left.shape != right.shape or left.shape[-1] % self.stride or left.shape[-2] % self.stride:
            raise ValueError(
                f"{type(self).__name__} needs two images of one size, a multiple of {self.stride} each way; got "
                f"{tuple(left.shape)} and {tuple(right.shape)}"
            )


@dataclass(frozen=True)
class Fitting:
    """Images of any size, brought to multiples of a stride, and maps brought back."""

    height: int
    """Of the images, in pixels."""
    width: int
    """Of the images, in pixels."""
    stride: int
    """Both sizes become multiples of this."""

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) that the network sees: the next multiples of the stride."""
        return _next_multiple(self.height, self.stride), _next_multiple(self.width, self.stride)

    @property
    def stretch(self) -> tuple[float, float]:
        """Factors (horizontal, vertical) by which the images grow."""
        return 1.0, 1.0

    def apply(self, image: Tensor) -> Tensor:
        """Bring an image (B, C, H, W) to `size`."""
        raise NotImplementedError

    def undo(self, maps: Tensor) -> Tensor:
        """Bring maps (B, C, h, w) of `size` back to the images' size; values stay as they are."""
        raise NotImplementedError


class Padding(Fitting):
    """The last row and column are repeated.

    Examples:
        >>> import torch
        >>> padding = Padding(375, 1242, 16)
        >>> padding.apply(torch.rand(1, 3, 375, 1242)).shape
        torch.Size([1, 3, 384, 1248])
    """

    def apply(self, image: Tensor) -> Tensor:
        """Repeat the last row and column of an image (B, C, H, W)."""
        height, width = self.size
        missing = (0, width - self.width, 0, height - self.height)
        return F.pad(image, missing, mode="replicate") if any(missing) else image

    def undo(self, maps: Tensor) -> Tensor:
        """Cut the repeated rows and columns off."""
        return maps[..., : self.height, : self.width]


@dataclass(frozen=True)
class Resizing(Fitting):
    """The images are stretched.

    Examples:
        >>> Resizing(375, 1242, 64).size
        (384, 1280)
    """

    @property
    def stretch(self) -> tuple[float, float]:
        """Factors (horizontal, vertical) by which the images grow."""
        height, width = self.size
        return width / self.width, height / self.height

    def apply(self, image: Tensor) -> Tensor:
        """Resize an image (B, C, H, W)."""
        return resize(image, *self.size)

    def undo(self, maps: Tensor) -> Tensor:
        """Resize maps back."""
        return resize(maps, self.height, self.width)


def with_mirrored(left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
    """Pairs (B, 3, H, W), and after them the same with views swapped and mirrored, which are rectified pairs, too."""
    return torch.cat([left, right.flip(-1)]), torch.cat([right, left.flip(-1)])


def _next_multiple(length: int, stride: int) -> int:
    return -(-length // stride) * stride


def resize(maps: Tensor, height: int, width: int, mode: str = "bilinear", antialias: bool = True) -> Tensor:
    """Resize maps (B, C, h, w) to (B, C, height, width), antialiased when shrinking unless that is not wanted.

    Returns the maps themselves if they have that size already.
    """
    if maps.shape[-2:] == (height, width):
        return maps
    return F.interpolate(maps, size=(height, width), mode=mode, align_corners=False, antialias=antialias)

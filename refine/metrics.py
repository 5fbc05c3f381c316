"""Error measures of disparity maps and confidences, an image at a time or pooled over a set.

Everywhere: pixels without ground truth (NaN) do not count, a mask without pixels gives NaN and never 0, and a
pixel with ground truth but no estimate (NaN) counts as bad in every rate and is left out of every mean error.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stereoforge_kit.errors import InputError

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


def end_point_error(disparity: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Mean |d - d*| in pixels.

    Args:
        disparity: (H, W) estimate.
        truth: (H, W) ground truth, NaN where unknown.
        mask: (H, W) bool, where to look; everywhere if None.
    """
    return ErrorPool().add(disparity, truth, mask).end_point_error


def bad_pixel_rate(
    disparity: ArrayLike, truth: ArrayLike, threshold: float = 1.0, mask: ArrayLike | None = None
) -> float:
    """Share (0..1) of pixels with |d - d*| > `threshold` pixels; arguments as for `end_point_error`."""
    return ErrorPool(threshold).add(disparity, truth, mask).bad_pixel_rate


def gradient_error(gradient: ArrayLike, truth_gradient: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Mean |Gx - Gx*| plus mean |Gy - Gy*|, pixels a pixel (the paper's gradient EPE, Tables 1 and 4).

    Args:
        gradient: (H, W, 2) as [dx, dy]; for a disparity map its `forward_gradient`.
        truth_gradient: (H, W, 2), NaN where undefined.
        mask: (H, W) bool, where to look; `smooth_mask` gives the paper's. Everywhere if None.
    """
    return GradientPool().add(gradient, truth_gradient, mask).gradient_error


def forward_gradient(disparity: ArrayLike) -> Floats:
    """Forward differences [dx, dy] of a disparity map: (H, W) to (H, W, 2), NaN where a pixel has no
    neighbour."""
    values = np.asarray(disparity, dtype=np.float64)
    dx = np.diff(values, axis=1, append=np.nan)
    dy = np.diff(values, axis=0, append=np.nan)
    return np.stack([dx, dy], axis=2)


def smooth_mask(truth_gradient: ArrayLike, threshold: float = 1.0) -> Mask:
    """Pixels with no forward difference above `threshold`: where the paper measures and trains gradients.

    The paper's threshold is unreadable in print; 1 pixel is our reading.
    """
    size = np.abs(np.asarray(truth_gradient, dtype=np.float64))
    steep = (np.nan_to_num(size, nan=0.0) > threshold).any(axis=2)
    smooth: Mask = ~steep & np.isfinite(size).any(axis=2)
    return smooth


@dataclass
class ErrorPool:
    """Disparity errors summed pixel by pixel over any number of images."""

    threshold: float = 1.0
    """Errors above it are bad, in pixels."""
    pixels: int = 0
    missing: int = 0
    """Pixels with ground truth but without an estimate."""
    bad: int = 0
    total_error: float = 0.0

    def add(self, disparity: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> Self:
        """Take in one image (arguments as for `end_point_error`)."""
        error = _errors(disparity, truth, mask)
        known = error[np.isfinite(error)]
        self.pixels += error.size
        self.missing += error.size - known.size
        self.bad += int((known > self.threshold).sum()) + error.size - known.size
        self.total_error += float(known.sum())
        return self

    def merge(self, other: ErrorPool) -> None:
        """Take in what another pool has summed."""
        self.pixels += other.pixels
        self.missing += other.missing
        self.bad += other.bad
        self.total_error += other.total_error

    @property
    def bad_pixel_rate(self) -> float:
        """Share of pixels with ground truth whose error exceeds the threshold; NaN without a pixel."""
        return self.bad / self.pixels if self.pixels else float("nan")

    @property
    def end_point_error(self) -> float:
        """Mean absolute error in pixels; NaN without a pixel."""
        estimated = self.pixels - self.missing
        return self.total_error / estimated if estimated else float("nan")


@dataclass
class GradientPool:
    """Gradient errors summed over any number of images, the two directions apart."""

    counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, np.int64))
    totals: Floats = field(default_factory=lambda: np.zeros(2))

    def add(self, gradient: ArrayLike, truth_gradient: ArrayLike, mask: ArrayLike | None = None) -> Self:
        """Take in one image (arguments as for `gradient_error`)."""
        estimate = np.asarray(gradient, dtype=np.float64)
        truth = np.asarray(truth_gradient, dtype=np.float64)
        if estimate.shape != truth.shape or estimate.ndim != 3 or estimate.shape[2] != 2:
            raise InputError(f"gradients must be (H, W, 2) and alike, got {estimate.shape} and {truth.shape}")
        error = np.abs(estimate - truth)
        counted = np.isfinite(error) & _where(mask, error.shape[:2])[..., None]
        self.counts = self.counts + counted.sum(axis=(0, 1))
        self.totals = self.totals + np.where(counted, error, 0).sum(axis=(0, 1))
        return self

    def merge(self, other: GradientPool) -> None:
        """Take in what another pool has summed."""
        self.counts = self.counts + other.counts
        self.totals = self.totals + other.totals

    @property
    def gradient_error(self) -> float:
        """Mean absolute error of dx plus that of dy, pixels per pixel; NaN without a pixel."""
        return float((self.totals / self.counts).sum()) if self.counts.all() else float("nan")


@dataclass(frozen=True)
class SparsificationCurve:
    """How the bad-pixel rate falls as the least confident pixels are removed (the paper's Fig. 4)."""

    removed: Floats
    """(N,) shares of the pixels removed, 0..1."""
    bad_rate: Floats
    """(N,) bad rate of the pixels kept; at share 1, where none are, that of the step before."""

    @property
    def auc(self) -> float:
        """Area under the curve, by the trapezoid rule; NaN for a mask without pixels."""
        # Here, since it takes a tenth of a second and refining has no use for it.
        from scipy.integrate import trapezoid

        return float(trapezoid(self.bad_rate, self.removed))


def sparsification_curve(
    disparity: ArrayLike,
    truth: ArrayLike,
    confidence: ArrayLike,
    threshold: float = 1.0,
    mask: ArrayLike | None = None,
    steps: int = 200,
) -> SparsificationCurve:
    """Bad rate of the remaining pixels against the share removed, least confident first.

    Pixels of equal confidence are removed in random order on average: the curve is the expected one, so a
    constant confidence gives a flat line and the result does not depend on the order of pixels.

    Args:
        disparity, truth, mask: As for `end_point_error`.
        confidence: (H, W), higher is surer, any scale; NaN is removed first.
        threshold: Errors above it are bad, in pixels.
        steps: Number of equal steps from nothing removed to everything removed.
    """
    scores = np.nan_to_num(np.asarray(confidence, dtype=np.float64), nan=-np.inf)
    where = _counted(disparity, truth, mask)
    if scores.shape != where.shape:
        raise InputError(f"confidence has shape {scores.shape}, the disparity {where.shape}")
    error = _errors(disparity, truth, mask)
    bad = ~(error <= threshold)
    removed = np.linspace(0, 1, steps + 1)
    if error.size == 0:
        return SparsificationCurve(removed, np.full(steps + 1, np.nan))
    _, group, sizes = np.unique(scores[where], return_inverse=True, return_counts=True)
    bad_in_group = np.bincount(group, weights=bad)
    gone = np.concatenate([[0], np.cumsum(sizes)]) / error.size
    bad_gone = np.concatenate([[0], np.cumsum(bad_in_group)]) / error.size
    bad_left = bad_gone[-1] - np.interp(removed[:-1], gone, bad_gone)
    rate = np.clip(bad_left / (1 - removed[:-1]), 0, 1)
    return SparsificationCurve(removed, np.append(rate, rate[-1]))


def optimal_curve(bad_rate: float, steps: int = 200) -> SparsificationCurve:
    """The curve of a confidence that knows every bad pixel: max(0, e - r) / (1 - r) for share r removed."""
    removed = np.linspace(0, 1, steps + 1)
    rate = np.maximum(bad_rate - removed[:-1], 0) / (1 - removed[:-1])
    return SparsificationCurve(removed, np.append(rate, rate[-1]))


def optimal_auc(bad_rate: float) -> float:
    """Area under the optimal curve for a bad rate e: e + (1 - e) ln(1 - e); NaN for a rate of NaN.

    Hu and Mordohai, "A quantitative evaluation of confidence measures for stereo vision", PAMI 2012.
    """
    if bad_rate < 0 or bad_rate > 1:
        raise InputError(f"a bad rate is between 0 and 1, got {bad_rate}")
    return 1.0 if bad_rate == 1 else float(bad_rate + (1 - bad_rate) * np.log1p(-bad_rate))


@dataclass(frozen=True)
class KittiD1:
    """KITTI 2015's outlier rates, shares 0..1; NaN where a class has no pixels."""

    background: float
    foreground: float
    all: float


def kitti_d1(disparity: ArrayLike, truth: ArrayLike, object_map: ArrayLike | None = None) -> KittiD1:
    """Share of pixels whose error exceeds both 3 pixels and 5 % of the true disparity (KITTI 2015's D1).

    Args:
        disparity, truth: As for `end_point_error`.
        object_map: (H, W), 0 background, anything else foreground; all background if None.
    """
    return D1Pool().add(disparity, truth, object_map).rates


@dataclass
class D1Pool:
    """Outliers of KITTI 2015 counted over any number of images, background and foreground apart."""

    pixels: NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, np.int64))
    """[background, foreground] with ground truth."""
    outliers: NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, np.int64))

    def add(self, disparity: ArrayLike, truth: ArrayLike, object_map: ArrayLike | None = None) -> Self:
        """Take in one image (arguments as for `kitti_d1`)."""
        values = np.asarray(truth, dtype=np.float64)
        where = _counted(disparity, truth, None)
        error = np.abs(np.asarray(disparity, dtype=np.float64) - values)
        outlier = ~((error <= 3) | (error <= 0.05 * np.abs(values)))
        foreground = np.zeros(values.shape, bool) if object_map is None else np.asarray(object_map) != 0
        if foreground.shape != values.shape:
            raise InputError(f"the object map has shape {foreground.shape}, the disparity {values.shape}")
        classes = (where & ~foreground, where & foreground)
        self.pixels = self.pixels + [mask.sum() for mask in classes]
        self.outliers = self.outliers + [outlier[mask].sum() for mask in classes]
        return self

    def merge(self, other: D1Pool) -> None:
        """Take in what another pool has counted."""
        self.pixels = self.pixels + other.pixels
        self.outliers = self.outliers + other.outliers

    @property
    def rates(self) -> KittiD1:
        """The outlier rates of background, foreground and all pixels."""
        counted = np.append(self.pixels, self.pixels.sum())
        wrong = np.append(self.outliers, self.outliers.sum())
        background, foreground, everything = np.where(counted > 0, wrong / np.maximum(counted, 1), np.nan)
        return KittiD1(float(background), float(foreground), float(everything))


def _errors(disparity: ArrayLike, truth: ArrayLike, mask: ArrayLike | None) -> Floats:
    """|d - d*| of the pixels that count, flat; NaN where the estimate is missing."""
    where = _counted(disparity, truth, mask)
    estimate = np.asarray(disparity, dtype=np.float64)[where]
    error = np.abs(estimate - np.asarray(truth, dtype=np.float64)[where])
    return np.where(np.isfinite(error), error, np.nan)


def _counted(disparity: ArrayLike, truth: ArrayLike, mask: ArrayLike | None) -> Mask:
    values, estimate = np.asarray(truth, dtype=np.float64), np.asarray(disparity)
    if estimate.shape != values.shape or values.ndim != 2:
        raise InputError(
            f"disparity and ground truth must be (H, W) and alike, got {estimate.shape}, {values.shape}"
        )
    return np.isfinite(values) & _where(mask, values.shape)


def _where(mask: ArrayLike | None, shape: tuple[int, ...]) -> Mask:
    if mask is None:
        return np.ones(shape, bool)
    where = np.asarray(mask)
    if where.shape != shape or where.dtype != np.bool_:
        raise InputError(f"a mask must be bool of shape {shape}, got {where.dtype} {where.shape}")
    return where

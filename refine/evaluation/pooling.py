"""Sums over pixels from which every measure of a method follows. The sums of frames add up to those of a set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refine.method import EvaluationFrame, MethodOutput
from refine.metrics import D1Pool, ErrorPool, GradientPool, KittiD1, forward_gradient, smooth_mask
from stereoforge_kit.errors import InputError

REGIONS = ("all", "occ")
"""All: every pixel with ground truth. Occ: those occluded in the other view or out of its frame."""


@dataclass(frozen=True)
class RegionScore:
    """Disparity errors over one region of the pixels."""

    bad: float
    """Share of bad pixels, 0..1; NaN where the region has no pixels or the method no disparity."""
    epe: float
    """Mean |d - d*| in pixels, where there is an estimate."""
    pixels: int
    missing: int
    """Those of the pixels for which the method gives no disparity: bad, and left out of the mean error."""


@dataclass(frozen=True)
class MethodScore:
    """All measures of one method, over one frame or pooled over a set."""

    regions: dict[str, RegionScore]
    """By the names in `REGIONS`."""
    gradient_masked: float
    """Gradient error where the ground truth is smooth (the paper's Tables 1, 4, 5)."""
    gradient_all: float
    """Gradient error over every pixel, discontinuities included."""
    d1: KittiD1
    """KITTI's outliers; without an object map everything is background."""
    seconds: float
    """Mean wall-clock time a frame: of the networks for what they predict, else of the method by itself, on top
    of what it is given."""

    def measures(self) -> dict[str, float]:
        """Every measure by its name in the files: those of `MEASURES`."""
        values: dict[str, float] = {}
        for name, region in self.regions.items():
            values |= {
                f"bad_{name}": region.bad,
                f"epe_{name}": region.epe,
                f"pixels_{name}": region.pixels,
                f"missing_{name}": region.missing,
            }
        return values | {
            "gradient_masked": self.gradient_masked,
            "gradient_all": self.gradient_all,
            "d1_bg": self.d1.background,
            "d1_fg": self.d1.foreground,
            "d1_all": self.d1.all,
            "seconds": self.seconds,
        }


MEASURES = (
    *(f"{measure}_{region}" for region in REGIONS for measure in ("bad", "epe", "pixels", "missing")),
    "gradient_masked",
    "gradient_all",
    "d1_bg",
    "d1_fg",
    "d1_all",
    "seconds",
)
"""Names of a method's measures. bad, d1: shares 0..1; epe: pixels; pixels, missing: counts; gradient: pixels a
pixel; seconds: a frame."""


@dataclass
class MethodPool:
    """Running sums of one method."""

    gradient_threshold: float
    """Ground-truth forward differences above it are left out of the masked gradient error."""
    regions: dict[str, ErrorPool]
    masked: GradientPool
    everywhere: GradientPool
    d1: D1Pool
    seconds: float = 0.0
    timed: int = 0
    """Frames that `seconds` are of."""

    @classmethod
    def empty(cls, bad_threshold: float, gradient_threshold: float) -> MethodPool:
        """A pool without a pixel."""
        regions = {name: ErrorPool(bad_threshold) for name in REGIONS}
        return cls(gradient_threshold, regions, GradientPool(), GradientPool(), D1Pool())

    def add(self, frame: EvaluationFrame, output: MethodOutput, seconds: float) -> None:
        """Add one frame. Raises InputError for an output with neither a disparity nor a gradient."""
        if output.disparity is not None:
            self.regions["all"].add(output.disparity, frame.truth)
            self.regions["occ"].add(output.disparity, frame.truth, frame.occlusion > 0)
            self.d1.add(output.disparity, frame.truth, frame.objects)
        if output.gradient is not None:
            gradient = np.asarray(output.gradient, dtype=np.float64)
        elif output.disparity is not None:
            gradient = forward_gradient(output.disparity)
        else:
            raise InputError("a method gave neither a disparity nor a gradient")
        truth = forward_gradient(frame.truth)
        self.masked.add(gradient, truth, smooth_mask(truth, self.gradient_threshold))
        self.everywhere.add(gradient, truth)
        self.seconds += seconds
        self.timed += 1

    def forget_seconds(self) -> None:
        """Count the time of later frames only."""
        self.seconds, self.timed = 0.0, 0

    def merge(self, other: MethodPool) -> None:
        """Add the sums of another pool."""
        for name, pool in other.regions.items():
            self.regions[name].merge(pool)
        self.masked.merge(other.masked)
        self.everywhere.merge(other.everywhere)
        self.d1.merge(other.d1)
        self.seconds += other.seconds
        self.timed += other.timed

    def score(self) -> MethodScore:
        """The measures; NaN for those without a pixel."""
        return MethodScore(
            regions={
                name: RegionScore(pool.bad_pixel_rate, pool.end_point_error, pool.pixels, pool.missing)
                for name, pool in self.regions.items()
            },
            gradient_masked=self.masked.gradient_error,
            gradient_all=self.everywhere.gradient_error,
            d1=self.d1.rates,
            seconds=self.seconds / max(self.timed, 1),
        )

    def fractions(self) -> dict[str, NDArray[np.float64]]:
        """Each error measure as a sum of fractions, (N, 2) of [numerator, denominator].

        The numerators and denominators add up over frames, so a resampled set's measures follow from them.
        """
        values: dict[str, NDArray[np.float64]] = {}
        for name, pool in self.regions.items():
            values[f"bad_{name}"] = np.array([[pool.bad, pool.pixels]], np.float64)
            values[f"epe_{name}"] = np.array([[pool.total_error, pool.pixels - pool.missing]], np.float64)
        for name, gradients in (("masked", self.masked), ("all", self.everywhere)):
            values[f"gradient_{name}"] = np.stack([gradients.totals, gradients.counts], axis=1)
        background, foreground = np.stack([self.d1.outliers, self.d1.pixels], axis=1).astype(np.float64)
        return values | {
            "d1_bg": background[None],
            "d1_fg": foreground[None],
            "d1_all": (background + foreground)[None],
        }

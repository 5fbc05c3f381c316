"""Meeting a histogram of disparities by choosing each scene's depths and baseline.

The disparities of one scene are spread about their median in the family's way, and the baseline puts that median
anywhere without changing the left view. So the histogram of a data set is a mixture of the family's spread at different
medians. Families that place things by disparity have several spreads, narrow and wide. A few preflight scenes, of no
split, show those spreads once; the mixture nearest to the histogram is written into the recipe, and the number of a
scene decides which component of the mixture the scene belongs to.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from datagen.errors import DatasetError
from datagen.recipe.disparity_range import surface_disparities
from scenes import FAMILIES, FamilyConfig, sample_scene
from stereoforge_kit.errors import InputError

PREFLIGHT_KEY = 3
"""First number of the preflight scenes' random streams, beside those of the three splits."""
PREFLIGHT_SCENES = 16
"""Scenes sampled for each spread."""
NARROW_RANGES = (4.0, 20.0)
"""Ratios of greatest to least disparity that families which place things by disparity try besides their own."""
MEDIANS = 40
"""Number of candidate medians, evenly spaced in the logarithm over somewhat more than the histogram's extent."""
NEGLIGIBLE = 1e-3
"""Components with less than this share are left out."""
_GOLDEN = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class Component:
    """One component of the mixture: a share of the scenes, with the same median and spread."""

    share: float
    """Share of the scenes, 0 to 1."""
    median_px: float
    """The median of the surfaces' disparities, which the baseline is chosen for."""
    ratio: float | None = None
    """Ratio of greatest to least disparity, for families that choose depths; None for the family's own."""


@dataclass(frozen=True)
class DisparityHistogram:
    """How the disparities of surfaces shall be distributed over the left views of all scenes together.

    Raises DatasetError for edges and shares that are no histogram.
    """

    edges_px: tuple[float, ...]
    """The edges of the bins in px, increasing."""
    shares: tuple[float, ...]
    """The share of pixels in each bin; they add up to 1."""
    components: tuple[Component, ...] = ()
    """The mixture that meets it, found by `fit_components`; empty until then."""

    def __post_init__(self) -> None:
        if len(self.edges_px) != len(self.shares) + 1 or not self.shares:
            raise DatasetError("a disparity histogram needs one more edge than shares")
        if self.edges_px[0] < 0 or any(b <= a for a, b in pairwise(self.edges_px)):
            raise DatasetError(
                f"the edges of a disparity histogram must increase from 0, got {self.edges_px}"
            )
        if min(self.shares) < 0 or abs(sum(self.shares) - 1) > 1e-6:
            raise DatasetError(f"the shares of a disparity histogram must add up to 1, got {self.shares}")

    def component(self, scene: int) -> Component:
        """The component of a split's scene with this number.

        Any run of scenes holds each component about as often as its share says. Raises ValueError if there are no
        components yet.
        """
        if not self.components:
            raise InputError("the disparity histogram has no components yet; fit_disparities finds them")
        turn = (scene + 0.5) * _GOLDEN % 1.0
        bounds = np.cumsum([component.share for component in self.components])
        return self.components[min(int(np.searchsorted(bounds, turn * bounds[-1])), len(bounds) - 1)]

    def missed(self, disparity: NDArray[np.floating[Any]]) -> float:
        """Share of the surfaces' pixels, those above 0 px, that would have to change bins to meet the histogram."""
        surfaces = disparity[disparity > 0]
        found = np.histogram(surfaces, self.edges_px)[0] / max(len(surfaces), 1)
        return float(np.maximum(np.array(self.shares) - found, 0).sum())


def with_depths(world: FamilyConfig, component: Component) -> FamilyConfig:
    """A family's config with the spread of depths that a component asks for."""
    return world if component.ratio is None else world.within_disparities(1.0, component.ratio)


def fit_components(wanted: DisparityHistogram, world: FamilyConfig, seed: int) -> DisparityHistogram:
    """The histogram with the mixture of components that comes nearest to it for a family's worlds.

    The shares are non-negative and add up to 1; they minimise the squared differences between the cumulative
    distributions at the edges. Some scenes are sampled and ray-cast, which takes seconds.
    """
    family = next(name for name, kind in FAMILIES.items() if type(world) is kind.config)
    ratios = (None, *NARROW_RANGES) if world.depths_for_range else (None,)
    lowest = max(wanted.edges_px[0], wanted.edges_px[1] / 8)
    medians = np.geomspace(lowest / 1.5, wanted.edges_px[-1] * 1.5, MEDIANS)
    candidates = [Component(1.0, float(f"{px:.4g}"), ratio) for ratio in ratios for px in medians]
    spreads = {
        ratio: _spread(with_depths(world, Component(1.0, 1.0, ratio)), family, seed) for ratio in ratios
    }
    columns = [
        np.searchsorted(spreads[one.ratio], np.array(wanted.edges_px) / one.median_px)
        / len(spreads[one.ratio])
        for one in candidates
    ]
    goal = np.concatenate([[0.0], np.cumsum(wanted.shares)])
    # Shares that do not add up to 1 cost far more than any misfit.
    system = np.vstack([np.stack(columns, axis=1), np.full(len(candidates), 100.0)])
    weights, _ = nnls(system, np.append(goal, 100.0))
    kept = [
        replace(one, share=float(f"{weight:.4g}"))
        for one, weight in zip(candidates, weights, strict=True)
        if weight > NEGLIGIBLE
    ]
    kept.sort(key=lambda one: one.median_px)
    return replace(wanted, components=tuple(kept))


def _spread(world: FamilyConfig, family: str, seed: int) -> NDArray[np.float64]:
    """(P,) sorted disparities of the preflight scenes' surfaces, each divided by its scene's median.

    Every scene has the same weight.
    """
    pooled = []
    for number in range(PREFLIGHT_SCENES):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(PREFLIGHT_KEY, number)))
        disparity = surface_disparities(sample_scene(rng, family, world))
        if len(disparity):
            quantiles = np.quantile(disparity, np.linspace(0.0005, 0.9995, 1000))
            pooled.append(quantiles / np.median(disparity))
    return np.sort(np.concatenate(pooled))

"""Bootstrap confidence intervals of the measures, with scenes as the unit of resampling.

Frames of one scene share its objects, textures and camera, and pixels share everything, so neither are
independent draws. Whole scenes are: they are drawn with replacement, as many as there are, and every measure is
pooled anew over what was drawn (Efron, "Bootstrap methods", Annals of Statistics 7, 1979; the percentile interval).
Ratios are formed within each draw, so what makes a scene hard for both methods cancels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refine.evaluation.evaluate import Evaluation

REFERENCE = "regressor"
"""Ratios are to this method."""
LEVEL = 0.95
RESAMPLES = 1000
FEWEST_SCENES = 5
"""Of fewer, the ends of a percentile interval are little more than the best and the worst scene's own."""


@dataclass(frozen=True)
class Interval:
    """A confidence interval of level `LEVEL`; NaN where it is not known."""

    low: float = float("nan")
    high: float = float("nan")


UNKNOWN = Interval()


@dataclass(frozen=True)
class Bootstrap:
    """Intervals of every error measure of every method."""

    scenes: int
    resamples: int
    seed: int
    values: Mapping[str, Mapping[str, Interval]]
    """By method, then by measure (`refine.evaluation.pooling.MEASURES`)."""
    ratios: Mapping[str, Mapping[str, Interval]]
    """Of the measure to the regressor's; empty where there is none."""


def bootstrap(evaluation: Evaluation, resamples: int = RESAMPLES, seed: int = 0) -> Bootstrap:
    """Resample an evaluation's scenes; with fewer than `FEWEST_SCENES` nothing is known and every end is NaN."""
    scenes = list(dict.fromkeys(frame.scene for frame in evaluation.frames))
    count = len(scenes)
    draws = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), size=resamples)
    drawn = {
        method: {
            measure: _resampled(draws.astype(np.float64), sums)
            for measure, sums in _scene_sums(evaluation, method, scenes).items()
        }
        for method in evaluation.scores
    }
    reference = drawn.get(REFERENCE)
    ratios: dict[str, dict[str, Interval]] = {}
    if reference is not None:
        for method, measures in drawn.items():
            with np.errstate(divide="ignore", invalid="ignore"):
                ratios[method] = {
                    name: _interval(values / reference[name], count) for name, values in measures.items()
                }
    values = {
        method: {name: _interval(sample, count) for name, sample in measures.items()}
        for method, measures in drawn.items()
    }
    return Bootstrap(count, resamples, seed, values, ratios)


def _scene_sums(evaluation: Evaluation, method: str, scenes: list[str]) -> dict[str, NDArray[np.float64]]:
    """Each measure's fractions summed over each scene's frames, (scenes, N, 2)."""
    place = {scene: index for index, scene in enumerate(scenes)}
    sums: dict[str, NDArray[np.float64]] = {}
    for frame in evaluation.frames:
        for measure, fractions in frame.pools[method].fractions().items():
            whole = sums.setdefault(measure, np.zeros((len(scenes), *fractions.shape)))
            whole[place[frame.scene]] += fractions
    return sums


def _resampled(draws: NDArray[np.float64], sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """The measure of each draw, (resamples,); NaN where what was drawn has no pixel."""
    totals = np.tensordot(draws, sums, axes=1)
    numerators, denominators = totals[..., 0], totals[..., 1]
    shares = np.where(denominators > 0, numerators / np.maximum(denominators, 1), np.nan)
    measure: NDArray[np.float64] = shares.sum(axis=1)
    return measure


def _interval(sample: NDArray[np.float64], scenes: int) -> Interval:
    known = sample[np.isfinite(sample)]
    if scenes < FEWEST_SCENES or known.size == 0:
        return UNKNOWN
    low, high = np.quantile(known, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(float(low), float(high))

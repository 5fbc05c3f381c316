"""Random draws as plain Python numbers, because what records store must survive JSON unchanged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")

Range = tuple[float, float]
"""Lower and upper bound of a uniform draw."""
Count = tuple[int, int]
"""Smallest and largest number, both included."""


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Uniform over low .. high."""
    return float(rng.uniform(low, high))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform over low .. high, for sizes and other quantities that vary over decades."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def integer(rng: np.random.Generator, low: int, high: int) -> int:
    """Uniform over low .. high, both ends included."""
    return int(rng.integers(low, high + 1))


def chance(rng: np.random.Generator, probability: float) -> bool:
    """True with a probability."""
    return bool(rng.random() < probability)


def choose(rng: np.random.Generator, options: Sequence[T], weights: Sequence[float] | None = None) -> T:
    """One of `options`, in proportion to `weights` (equal ones by default)."""
    if weights is None:
        return options[int(rng.integers(len(options)))]
    cumulative = np.cumsum(weights)
    drawn = int(np.searchsorted(cumulative, rng.random() * cumulative[-1], side="right"))
    return options[min(drawn, len(options) - 1)]


def new_seed(rng: np.random.Generator) -> int:
    """A seed for a record's own noise, below 2^53 so that every JSON reader keeps it exactly."""
    return int(rng.integers(2**53))

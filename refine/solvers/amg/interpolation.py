"""Between a level and the next: interpolation and its transpose, one list of entries for both.

Interpolation has about one entry a row. By rows, most of the time went into finding out where they end.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from refine.solvers.amg.csr import Indices, Rows
from refine.solvers.amg.sell import WINDOW
from refine.solvers.stencil.operator import Singles

_CHUNKS = 8


@dataclass(frozen=True)
class Transfer:
    """P, by entries."""

    fine: Indices
    coarse: Indices
    weight: Singles
    bounds: NDArray[np.int64]
    """Of chunks of entries: no two have a fine unknown in common, and no two that are not neighbours a coarse
    one."""

    def restrict(self, values: Singles, out: Singles) -> None:
        """out = P' values."""
        _restrict(self.fine, self.coarse, self.weight, self.bounds, values, out)

    def prolong(self, values: Singles, out: Singles) -> None:
        """out += P values."""
        _prolong(self.fine, self.coarse, self.weight, self.bounds, values, out)


def transfer_of(prolong: Rows, fine_position: Indices, coarse_position: Indices) -> Transfer:
    """Of an interpolation by rows; the positions say where an unknown is in its level's vectors, and those of one
    window (`refine.solvers.amg.sell`) stay together."""
    coarse = coarse_position[prolong.column]
    fine = np.repeat(fine_position, np.diff(prolong.start))
    windows = -(-fine_position.size // WINDOW)
    ends = np.linspace(0, windows, _CHUNKS + 1).astype(np.int64) * WINDOW
    bounds = prolong.start[np.minimum(ends, fine_position.size)].astype(np.int64)
    if not _apart(coarse, bounds):
        bounds = bounds[[0, -1]]
    return Transfer(fine, coarse, prolong.value, bounds)


def _apart(coarse: Indices, bounds: NDArray[np.int64]) -> bool:
    """Whether only neighbouring chunks have coarse unknowns in common."""
    chunks = [coarse[first:last] for first, last in pairwise(bounds) if last > first]
    if len(chunks) < _CHUNKS:
        return False
    most = np.maximum.accumulate([chunk.max() for chunk in chunks])
    least = np.minimum.accumulate([chunk.min() for chunk in chunks][::-1])[::-1]
    return bool((most[:-2] < least[2:]).all())


@njit(cache=True)
def _add(target, source, weight, values, out, first, last):
    for e in range(first, last):
        out[target[e]] += weight[e] * values[source[e]]


@njit(cache=True, parallel=True)
def _restrict(fine, coarse, weight, bounds, values, out):
    chunks = bounds.size - 1
    for j in prange(out.size):
        out[j] = 0
    for pair in prange((chunks + 1) // 2):
        _add(coarse, fine, weight, values, out, bounds[2 * pair], bounds[2 * pair + 1])
    for pair in prange(chunks // 2):
        _add(coarse, fine, weight, values, out, bounds[2 * pair + 1], bounds[2 * pair + 2])


@njit(cache=True, parallel=True)
def _prolong(fine, coarse, weight, bounds, values, out):
    for chunk in prange(bounds.size - 1):
        _add(fine, coarse, weight, values, out, bounds[chunk], bounds[chunk + 1])

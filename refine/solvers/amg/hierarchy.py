"""A multigrid hierarchy on the graph of couplings: classical coarsening (Ruge and Stueben) on compressed
rows, as numba kernels.

What ties neighbouring pixels together jumps by five orders of magnitude from one pixel to the next, along
every edge and every grain of texture. Coarse grids laid regularly over the image cannot follow that: five
designs were tried (see docs/solver.md). So coarse unknowns are chosen by strength, and interpolation follows
the strong couplings only.

The graph is a symmetric M-matrix M, kept as couplings w_ij = -M_ij > 0 and an excess e = M 1, so that a small
excess beside large couplings loses nothing to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from refine.solvers.amg.cf_splitting import lead_with_strong, split
from refine.solvers.amg.csr import Indices, Rows, of
from refine.solvers.amg.galerkin import galerkin_pieces, interpolation, joined
from refine.solvers.amg.interpolation import Transfer, transfer_of
from refine.solvers.amg.sell import by_windows
from refine.solvers.stencil.operator import Singles

STRENGTH = 0.5
"""A coupling is strong for i if it is at least this share of i's largest. At 0.25 the coarse levels hold
twice the couplings, and the iterations are the same."""
LOOSE = 0.2
"""An unknown whose couplings sum to less than this share of its diagonal is left to the smoother."""
COARSEST = 256
"""Up to this many unknowns a level is solved densely."""
_MAX_LEVELS = 30
_STALLED = 0.9
"""Coarsening ends where a level keeps more than this share of the one above."""
_CHUNKS = 8
"""Parts of a level that are split independently; a constant, so that results do not depend on threads."""
_CHUNK_FROM = 4096


class Smoother(Protocol):
    """One step of damped Jacobi on a level's M-matrix. Vectors are flat."""

    @property
    def size(self) -> int:
        """Of the level's vectors."""

    def from_zero(self, b: Singles, x: Singles, left: Singles) -> None:
        """A step from 0 into `x`, and b - M x into `left`."""

    def again(self, b: Singles, x: Singles, out: Singles) -> None:
        """A step from `x`, into `out`."""


Arrangement = Callable[[Rows, Singles, Indices], Smoother]
"""Couplings, excess, and where in its vectors each unknown is, to the smoother."""


@dataclass(frozen=True)
class Level:
    """One level: how it is smoothed, and how the next one is interpolated to it. The rest is for the cycle's use."""

    smoother: Smoother
    transfer: Transfer
    x: Singles
    left: Singles
    """Of the right-hand side; then the smoothed solution."""
    below: Singles
    """The next level's right-hand side."""


@dataclass(frozen=True)
class Hierarchy:
    """From the graph that was coarsened to the coarsest; at least one level and that."""

    levels: tuple[Level, ...]
    coarsest: Singles
    """Inverse of the coarsest matrix, dense; of its diagonal alone where coarsening ended early."""

    def correct(self, residual: Singles) -> Singles:
        """An approximate solution on the first level, by one symmetric V-cycle; overwritten by the next call."""
        side = residual
        for level in self.levels:
            level.smoother.from_zero(side, level.x, level.left)
            level.transfer.restrict(level.left, level.below)
            side = level.below
        correction = self.coarsest * side if self.coarsest.ndim == 1 else _product(self.coarsest, side)
        sides = (residual, *(level.below for level in self.levels[:-1]))
        for level, side in zip(reversed(self.levels), reversed(sides), strict=True):
            level.transfer.prolong(correction, level.x)
            level.smoother.again(side, level.x, level.left)
            correction = level.left
        return correction


def build_hierarchy(first: Callable[[], tuple[Rows, Singles, Indices]], arrange: Arrangement) -> Hierarchy:
    """Coarsen an M-matrix.

    Args:
        first: Makes its couplings, its excess, and says where in the first level's vectors its unknowns are. A
            function, so that none but the hierarchy holds the couplings, and only as long as it needs them.
        arrange: Makes the smoother of the first level.
    """
    levels: list[Level] = []
    graph, excess, position = first()
    smoother = arrange(graph, excess, position)
    while True:
        diagonal = _diagonal(graph.start, graph.value, excess)
        ends, state = lead_with_strong(*of(graph), diagonal, STRENGTH, LOOSE)
        split(graph.start, graph.column, ends, state, _bounds(state.size))
        prolong, coarse = interpolation(graph, diagonal, excess, ends, state)
        del ends, state
        pieces, excess = galerkin_pieces(graph, diagonal, excess, prolong, coarse, _bounds(coarse))
        del graph
        graph = joined(pieces)
        del pieces
        kept = coarse / diagonal.size
        last = coarse <= COARSEST or kept > _STALLED or len(levels) + 1 == _MAX_LEVELS
        below, new_position = (None, np.arange(coarse, dtype=np.int32)) if last else by_windows(graph, excess)
        transfer = transfer_of(prolong, position, new_position)
        vectors = (np.zeros(size, np.float32) for size in (smoother.size, smoother.size, coarse))
        levels.append(Level(smoother, transfer, *vectors))
        if below is None:
            break
        smoother, position = below, new_position
    dense = excess.size <= 4 * COARSEST
    coarsest = (
        _dense_inverse(graph, excess) if dense else _inverse(_diagonal(graph.start, graph.value, excess))
    )
    return Hierarchy(tuple(levels), coarsest)


def _bounds(size: int) -> NDArray[np.int64]:
    """Where the chunks of a level begin and end."""
    return np.linspace(0, size, (_CHUNKS if size >= _CHUNK_FROM else 1) + 1).astype(np.int64)


def _inverse(diagonal: Singles) -> Singles:
    return np.divide(1, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)


def _dense_inverse(graph: Rows, excess: Singles) -> Singles:
    size = excess.size
    if size == 0:
        return np.zeros((0, 0), np.float32)
    matrix = np.zeros((size, size))
    row = np.repeat(np.arange(size), np.diff(graph.start))
    np.add.at(matrix, (row, graph.column), -graph.value.astype(np.float64))
    matrix[np.diag_indices(size)] += excess - matrix.sum(axis=1)
    return np.linalg.pinv((matrix + matrix.T) / 2, hermitian=True).astype(np.float32)


@njit(cache=True, parallel=True)
def _diagonal(start, value, excess):
    diagonal = np.empty(excess.size, np.float32)
    for i in prange(excess.size):
        total = np.float64(excess[i])
        for e in range(start[i], start[i + 1]):
            total += value[e]
        diagonal[i] = total
    return diagonal


@njit(cache=True)
def _product(matrix, b):
    """A small dense product: BLAS would wake threads of its own, which then wait where ours want to work."""
    out = np.zeros(matrix.shape[0], matrix.dtype)
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[i] += matrix[i, j] * b[j]
    return out

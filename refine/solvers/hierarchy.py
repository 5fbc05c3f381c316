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

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from refine.solvers.rows import Indices, Rows
from refine.solvers.splitting import COARSE, split
from refine.solvers.stencils import Singles

STRENGTH = 0.5
"""A coupling is strong for i if it is at least this share of i's largest. At 0.25 the coarse levels hold
twice the couplings, and the iterations are the same."""
DAMPING = np.float32(0.7)
"""Of the Jacobi smoother, which takes as many iterations as Gauss-Seidel and no order (docs/solver.md)."""
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
    def step(self) -> Singles:
        """DAMPING / diagonal, 0 where that is 0."""

    def from_zero(self, b: Singles, x: Singles, left: Singles) -> None:
        """A step from 0 into `x`, and b - M x into `left`."""

    def again(self, b: Singles, x: Singles, out: Singles) -> None:
        """A step from `x`, into `out`."""


@dataclass(frozen=True)
class RowSmoother:
    """On couplings by rows."""

    graph: Rows
    step: Singles

    def from_zero(self, b: Singles, x: Singles, left: Singles) -> None:
        _from_zero(*_of(self.graph), self.step, b, x, left)

    def again(self, b: Singles, x: Singles, out: Singles) -> None:
        _again(*_of(self.graph), self.step, b, x, out)


@dataclass(frozen=True)
class Level:
    """One level: how it is smoothed, and how the next one is interpolated to it."""

    smoother: Smoother
    prolong: Rows
    restrict: Rows
    work: Singles
    """(3, unknowns) for the cycle's own use: right-hand side, solution and what is left of the former."""


@dataclass(frozen=True)
class Hierarchy:
    """From the graph that was coarsened to the coarsest; at least one level and that."""

    levels: tuple[Level, ...]
    coarsest: Singles
    """Inverse of the coarsest matrix, dense; of its diagonal alone where coarsening ended early."""

    def correct(self, residual: Singles) -> Singles:
        """An approximate solution on the first level, by one symmetric V-cycle; overwritten by the next call."""
        sides = [residual]
        for level, below in zip(self.levels, (*self.levels[1:], None), strict=True):
            _, x, left = level.work
            level.smoother.from_zero(sides[-1], x, left)
            sides.append(below.work[0] if below else np.empty(level.restrict.start.size - 1, np.float32))
            _multiply(*_of(level.restrict), left, sides[-1])
        b = sides.pop()
        correction = self.coarsest * b if self.coarsest.ndim == 1 else _product(self.coarsest, b)
        for level in reversed(self.levels):
            _, x, out = level.work
            _multiply_add(*_of(level.prolong), correction, x)
            level.smoother.again(sides.pop(), x, out)
            correction = out
        return correction

    def embedded(self, place: NDArray[np.int32], size: int, smoother: Smoother) -> Hierarchy:
        """The same for vectors of that size, the first level's unknowns at `place`, smoothed as given there."""
        first = self.levels[0]
        start = np.zeros(size + 1, np.int32)
        start[place + 1] = np.diff(first.prolong.start)
        np.cumsum(start, out=start)
        prolong = Rows(start, first.prolong.column, first.prolong.value)
        restrict = Rows(first.restrict.start, place[first.restrict.column], first.restrict.value)
        moved = Level(smoother, prolong, restrict, np.zeros((3, size), np.float32))
        return Hierarchy((moved, *self.levels[1:]), self.coarsest)


def build_hierarchy(graph: Rows, excess: Singles) -> Hierarchy:
    """Coarsen the M-matrix with these couplings and this excess."""
    levels: list[Level] = []
    kept = 0.0
    while not levels or (excess.size > COARSEST and kept <= _STALLED and len(levels) < _MAX_LEVELS):
        diagonal = _diagonal(graph.start, graph.value, excess)
        state, threshold = split(*_of(graph), diagonal, STRENGTH, LOOSE, _bounds(diagonal.size))
        prolong, coarse = _interpolation(graph, diagonal, state, threshold)
        restrict = _transposed(prolong, coarse)
        smoother = RowSmoother(graph, DAMPING * _inverse(diagonal))
        levels.append(Level(smoother, prolong, restrict, np.zeros((3, excess.size), np.float32)))
        graph, excess = _galerkin(graph, diagonal, excess, prolong, restrict)
        kept = coarse / state.size
    dense = excess.size <= 4 * COARSEST
    coarsest = (
        _dense_inverse(graph, excess) if dense else _inverse(_diagonal(graph.start, graph.value, excess))
    )
    return Hierarchy(tuple(levels), coarsest)


def _of(rows: Rows) -> tuple[Indices, Indices, Singles]:
    return rows.start, rows.column, rows.value


def _bounds(size: int) -> NDArray[np.int64]:
    """Where the chunks of a level begin and end."""
    return np.linspace(0, size, (_CHUNKS if size >= _CHUNK_FROM else 1) + 1).astype(np.int64)


def _interpolation(
    graph: Rows, diagonal: Singles, state: NDArray[np.int8], threshold: Singles
) -> tuple[Rows, int]:
    number = np.cumsum(state == COARSE, dtype=np.int32) - np.int32(1)
    coarse = int(number[-1]) + 1
    start = np.zeros(state.size + 1, np.int32)
    _count_interpolation(*_of(graph), state, threshold, start)
    np.cumsum(start, out=start)
    column, value = np.empty(start[-1], np.int32), np.empty(start[-1], np.float32)
    _fill_interpolation(*_of(graph), diagonal, state, number, threshold, start, column, value)
    return Rows(start, column, value), coarse


def _transposed(rows: Rows, columns: int) -> Rows:
    start = np.zeros(columns + 1, np.int32)
    column, value = np.empty_like(rows.column), np.empty_like(rows.value)
    _transpose(*_of(rows), start, column, value)
    return Rows(start, column, value)


def _galerkin(
    graph: Rows, diagonal: Singles, excess: Singles, prolong: Rows, restrict: Rows
) -> tuple[Rows, Singles]:
    """P' M P as couplings and excess."""
    coarse = restrict.start.size - 1
    start = np.zeros(coarse + 1, np.int32)
    pieces = _multiply_galerkin(*_of(graph), diagonal, *_of(prolong), *_of(restrict), _bounds(coarse), start)
    np.cumsum(start, out=start)
    column = np.concatenate([piece[0] for piece in pieces])
    value = np.concatenate([piece[1] for piece in pieces])
    next_excess = np.empty(coarse, np.float32)
    _coarse_excess(*_of(graph), excess, prolong.start, prolong.value, *_of(restrict), next_excess)
    return Rows(start, column, value), next_excess


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


@njit(cache=True, parallel=True)
def _count_interpolation(start, column, value, state, threshold, count):
    for i in prange(state.size):
        if state[i] == COARSE:
            count[i + 1] = 1
            continue
        for e in range(start[i], start[i + 1]):
            if state[column[e]] == COARSE and value[e] > 0 and value[e] >= threshold[i]:
                count[i + 1] += 1


@njit(cache=True, parallel=True)
def _fill_interpolation(start, column, value, diagonal, state, number, threshold, place, into, weight):
    """Direct interpolation: the strong coarse neighbours stand for all neighbours."""
    for i in prange(state.size):
        at = place[i]
        if state[i] == COARSE:
            into[at] = number[i]
            weight[at] = 1
            continue
        total = kept = np.float32(0)
        for e in range(start[i], start[i + 1]):
            total += value[e]
            if state[column[e]] == COARSE and value[e] > 0 and value[e] >= threshold[i]:
                kept += value[e]
                into[at] = number[column[e]]
                weight[at] = value[e]
                at += 1
        for e in range(place[i], at):
            # Across a hard edge all couplings may be next to nothing, and kept * diagonal would underflow.
            weight[e] = weight[e] / kept * (total / diagonal[i])


@njit(cache=True)
def _transpose(start, column, value, new_start, new_column, new_value):
    for j in column:
        new_start[j + 1] += 1
    for j in range(new_start.size - 1):
        new_start[j + 1] += new_start[j]
    free = new_start[:-1].copy()
    for i in range(start.size - 1):
        for e in range(start[i], start[i + 1]):
            at = free[column[e]]
            free[column[e]] += 1
            new_column[at] = i
            new_value[at] = value[e]


@njit(cache=True)
def _galerkin_rows(
    start, column, value, diagonal, p_start, p_column, p_value, r_start, r_column, r_value, first, last, count
):
    """Rows first to last of P' M P without the diagonal, as couplings."""
    columns = np.empty(16 * (last - first) + 64, np.int32)
    values = np.empty(columns.size, np.float32)
    met, sums = np.full(r_start.size - 1, -1, np.int32), np.empty(r_start.size - 1, np.float64)
    used = 0
    for row in range(first, last):
        before = used
        met[row] = row
        for e in range(r_start[row], r_start[row + 1]):
            i = r_column[e]
            for f in range(start[i] - 1, start[i + 1]):
                if f < start[i]:
                    k, factor = i, -np.float64(r_value[e]) * diagonal[i]
                else:
                    k, factor = column[f], np.float64(r_value[e]) * value[f]
                for g in range(p_start[k], p_start[k + 1]):
                    j = p_column[g]
                    if met[j] != row:
                        met[j] = row
                        sums[j] = 0
                        if used == columns.size:
                            columns = np.concatenate((columns, np.empty_like(columns)))
                            values = np.concatenate((values, np.empty_like(values)))
                        columns[used] = j
                        used += 1
                    sums[j] += factor * p_value[g]
        for at in range(before, used):
            values[at] = sums[columns[at]]
        count[row + 1] = used - before
    return columns[:used].copy(), values[:used].copy()


@njit(cache=True, parallel=True)
def _multiply_galerkin(
    start, column, value, diagonal, p_start, p_column, p_value, r_start, r_column, r_value, bounds, count
):
    empty = (np.empty(0, np.int32), np.empty(0, np.float32))
    pieces = [empty for _ in range(bounds.size - 1)]
    for part in prange(bounds.size - 1):
        pieces[part] = _galerkin_rows(
            start, column, value, diagonal, p_start, p_column, p_value,
            r_start, r_column, r_value, bounds[part], bounds[part + 1], count,
        )  # fmt: skip
    return pieces


@njit(cache=True, parallel=True)
def _coarse_excess(start, column, value, excess, p_start, p_value, r_start, r_column, r_value, out):
    """P' M P 1, from differences."""
    size = start.size - 1
    sums = np.zeros(size, np.float64)
    for i in prange(size):
        for e in range(p_start[i], p_start[i + 1]):
            sums[i] += p_value[e]
    image = np.empty(size, np.float64)
    for i in prange(size):
        total = excess[i] * sums[i]
        for e in range(start[i], start[i + 1]):
            total += value[e] * (sums[i] - sums[column[e]])
        image[i] = total
    for j in prange(out.size):
        total = 0.0
        for e in range(r_start[j], r_start[j + 1]):
            total += r_value[e] * image[r_column[e]]
        out[j] = total


@njit(cache=True)
def _product(matrix, b):
    """A small dense product: BLAS would wake threads of its own, which then wait where ours want to work."""
    out = np.zeros(matrix.shape[0], matrix.dtype)
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[i] += matrix[i, j] * b[j]
    return out


@njit(cache=True, parallel=True)
def _multiply(start, column, value, x, out):
    """out = R x."""
    for i in prange(out.size):
        total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            total += value[e] * x[column[e]]
        out[i] = total


@njit(cache=True, parallel=True)
def _multiply_add(start, column, value, x, out):
    """out += R x."""
    for i in prange(out.size):
        total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            total += value[e] * x[column[e]]
        out[i] += total


@njit(cache=True, parallel=True)
def _from_zero(start, column, value, step, b, x, left):
    for i in prange(b.size):
        x[i] = step[i] * b[i]
    for i in prange(b.size):
        total = (1 - DAMPING) * b[i]
        for e in range(start[i], start[i + 1]):
            total += value[e] * x[column[e]]
        left[i] = total


@njit(cache=True, parallel=True)
def _again(start, column, value, step, b, x, out):
    for i in prange(b.size):
        total = b[i]
        for e in range(start[i], start[i + 1]):
            total += value[e] * x[column[e]]
        out[i] = (1 - DAMPING) * x[i] + step[i] * total

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

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from refine.solvers.rows import Indices, Rows
from refine.solvers.stencils import Singles

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
"""Parts of a level that are split and relaxed independently; a constant, so that results do not depend on threads."""
_CHUNK_FROM = 4096


@dataclass(frozen=True)
class Level:
    """One level: its M-matrix, and how the next one is interpolated to it."""

    graph: Rows
    """Couplings, without the diagonal."""
    inverse_diagonal: Singles
    prolong: Rows
    restrict: Rows


@dataclass(frozen=True)
class Hierarchy:
    """From the graph that was coarsened to the coarsest."""

    levels: tuple[Level, ...]
    coarsest: Singles
    """Inverse of the coarsest matrix, dense; of its diagonal alone where coarsening ended early."""

    def correct(self, residual: Singles) -> Singles:
        """An approximate solution on the first level: one symmetric V-cycle."""
        return self._cycle(0, residual)

    def _cycle(self, depth: int, b: Singles) -> Singles:
        if depth == len(self.levels):
            return self.coarsest * b if self.coarsest.ndim == 1 else _product(self.coarsest, b)
        level = self.levels[depth]
        chunks = _CHUNKS if b.size >= _CHUNK_FROM else 1
        x, residual = np.empty_like(b), np.empty_like(b)
        _relax_from_zero(*_of(level.graph), level.inverse_diagonal, b, x, chunks)
        _residual_after(*_of(level.graph), x, residual, chunks)
        coarse = np.empty(level.restrict.start.size - 1, np.float32)
        multiply(*_of(level.restrict), residual, coarse)
        correction = self._cycle(depth + 1, coarse)
        multiply_add(*_of(level.prolong), correction, x)
        _relax_back(*_of(level.graph), level.inverse_diagonal, b, x, residual, chunks)
        return x


def build_hierarchy(graph: Rows, excess: Singles) -> Hierarchy:
    """Coarsen the M-matrix with these couplings (columns in order) and this excess."""
    levels: list[Level] = []
    kept = 0.0
    while excess.size > COARSEST and kept <= _STALLED and len(levels) < _MAX_LEVELS:
        diagonal = _diagonal(graph.start, graph.value, excess)
        state = _split(*_of(graph), diagonal, STRENGTH, LOOSE, _bounds(diagonal.size))
        prolong, coarse = _interpolation(graph, diagonal, state)
        restrict = _transposed(prolong, coarse)
        levels.append(Level(graph, _inverse(diagonal), prolong, restrict))
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


def _interpolation(graph: Rows, diagonal: Singles, state: NDArray[np.int8]) -> tuple[Rows, int]:
    number = np.cumsum(state == _COARSE, dtype=np.int32) - np.int32(1)
    coarse = int(number[-1]) + 1
    start = np.zeros(state.size + 1, np.int32)
    _count_interpolation(*_of(graph), state, STRENGTH, start)
    np.cumsum(start, out=start)
    column, value = np.empty(start[-1], np.int32), np.empty(start[-1], np.float32)
    _fill_interpolation(*_of(graph), diagonal, state, number, STRENGTH, start, column, value)
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


_UNDECIDED, _FINE, _COARSE = 0, 1, 2


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
def _split(start, column, value, diagonal, strength, loose, bounds):
    """Coarse and fine unknowns, by both passes of Ruge and Stueben 1987.

    The second sees to it that two fine unknowns with a strong coupling share a coarse one; without it the
    cycles converge several times slower. Both run in each chunk by itself, as if nothing were coupled across
    its bounds; then the second runs over what lies at the bounds.
    """
    size = diagonal.size
    threshold = np.empty(size, np.float32)
    state = np.zeros(size, np.int8)
    priority, seen = np.zeros(size, np.int32), np.full(size, -1, np.int32)
    after, before = np.full(size, -1, np.int32), np.full(size, -1, np.int32)
    for i in prange(size):
        largest = total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            largest = max(largest, value[e])
            total += value[e]
        threshold[i] = strength * largest
        if total <= loose * diagonal[i]:
            state[i] = _FINE
            threshold[i] = np.inf
    for part in prange(bounds.size - 1):
        first, last = bounds[part], bounds[part + 1]
        _first_pass(start, column, value, threshold, state, priority, after, before, first, last)
        for i in range(first, last):
            _second_pass(start, column, value, threshold, state, seen, i, first, last)
    for part in range(bounds.size - 1):
        first, last = bounds[part], bounds[part + 1]
        for i in range(first, last):
            across = start[i] < start[i + 1] and (
                column[start[i]] < first or column[start[i + 1] - 1] >= last
            )
            if across:
                _second_pass(start, column, value, threshold, state, seen, i, 0, size)
    return state


@njit(cache=True)
def _second_pass(start, column, value, threshold, state, seen, i, first, last):
    """One step of the second pass, for i, with the unknowns from first to last only."""
    if state[i] != _FINE or threshold[i] == np.inf:
        return
    for e in range(start[i], start[i + 1]):
        j = column[e]
        if first <= j < last and state[j] == _COARSE and value[e] >= threshold[i]:
            seen[j] = i
    tentative = -1
    for e in range(start[i], start[i + 1]):
        j = column[e]
        if not first <= j < last or state[j] != _FINE or value[e] < threshold[i] or threshold[j] == np.inf:
            continue
        shared = False
        for f in range(start[j], start[j + 1]):
            k = column[f]
            if first <= k < last and seen[k] == i and value[f] >= threshold[j]:
                shared = True
                break
        if not shared:
            if tentative >= 0:
                tentative = i
                break
            tentative = j
            seen[j] = i
    if tentative >= 0:
        state[tentative] = _COARSE


@njit(cache=True)
def _first_pass(start, column, value, threshold, state, priority, after, before, first, last):
    """Ruge and Stueben's first pass from first to last: next comes whatever most unknowns would gladly
    interpolate from.

    Unknowns wait in doubly linked lists, one a priority: the number of undecided unknowns that depend on
    one strongly, plus two for each that is fine already.
    """
    most = 0
    for i in range(first, last):
        for e in range(start[i], start[i + 1]):
            j = column[e]
            priority[i] += first <= j < last and value[e] >= threshold[j]
        most = max(most, start[i + 1] - start[i])
    head = np.full(2 * most + 2, -1, np.int32)
    for i in range(last - 1, first - 1, -1):
        if state[i] == _UNDECIDED:
            _insert(head, after, before, priority[i], i)
    top = head.size - 1
    while top >= 0:
        i = head[top]
        if i < 0:
            top -= 1
            continue
        _remove(head, after, before, top, i)
        state[i] = _COARSE
        for e in range(start[i], start[i + 1]):
            j = column[e]
            if not first <= j < last or state[j] != _UNDECIDED:
                continue
            if value[e] >= threshold[j]:
                state[j] = _FINE
                _remove(head, after, before, priority[j], j)
                for f in range(start[j], start[j + 1]):
                    k = column[f]
                    if first <= k < last and state[k] == _UNDECIDED and value[f] >= threshold[j]:
                        _remove(head, after, before, priority[k], k)
                        priority[k] += 1
                        _insert(head, after, before, priority[k], k)
                        top = max(top, priority[k])
            elif value[e] >= threshold[i]:
                _remove(head, after, before, priority[j], j)
                priority[j] -= 1
                _insert(head, after, before, priority[j], j)


@njit(cache=True)
def _insert(head, after, before, queue, i):
    after[i], before[i] = head[queue], -1
    if head[queue] >= 0:
        before[head[queue]] = i
    head[queue] = i


@njit(cache=True)
def _remove(head, after, before, queue, i):
    if before[i] >= 0:
        after[before[i]] = after[i]
    else:
        head[queue] = after[i]
    if after[i] >= 0:
        before[after[i]] = before[i]


@njit(cache=True)
def _strong(start, value, strength, i):
    """The smallest coupling by which i interpolates."""
    largest = np.float32(0)
    for e in range(start[i], start[i + 1]):
        largest = max(largest, value[e])
    return strength * largest


@njit(cache=True, parallel=True)
def _count_interpolation(start, column, value, state, strength, count):
    for i in prange(state.size):
        if state[i] == _COARSE:
            count[i + 1] = 1
            continue
        threshold = _strong(start, value, strength, i)
        for e in range(start[i], start[i + 1]):
            if state[column[e]] == _COARSE and value[e] > 0 and value[e] >= threshold:
                count[i + 1] += 1


@njit(cache=True, parallel=True)
def _fill_interpolation(start, column, value, diagonal, state, number, strength, place, into, weight):
    """Direct interpolation: the strong coarse neighbours stand for all neighbours."""
    for i in prange(state.size):
        at = place[i]
        if state[i] == _COARSE:
            into[at] = number[i]
            weight[at] = 1
            continue
        threshold = _strong(start, value, strength, i)
        total = kept = np.float32(0)
        for e in range(start[i], start[i + 1]):
            total += value[e]
            if state[column[e]] == _COARSE and value[e] > 0 and value[e] >= threshold:
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
    capacity = 16 * (last - first) + 64
    columns, values = np.empty(capacity, np.int32), np.empty(capacity, np.float32)
    where = np.full(r_start.size - 1, -1, np.int32)
    found, sums = np.empty(4096, np.int32), np.empty(4096, np.float64)
    used = 0
    for row in range(first, last):
        size = 0
        where[row] = -2
        for e in range(r_start[row], r_start[row + 1]):
            i = r_column[e]
            for f in range(start[i] - 1, start[i + 1]):
                if f < start[i]:
                    k, factor = i, -np.float64(r_value[e]) * diagonal[i]
                else:
                    k, factor = column[f], np.float64(r_value[e]) * value[f]
                for g in range(p_start[k], p_start[k + 1]):
                    j = p_column[g]
                    if where[j] == -1:
                        if size == found.size:
                            found = np.concatenate((found, np.empty_like(found)))
                            sums = np.concatenate((sums, np.empty_like(sums)))
                        where[j] = size
                        found[size] = j
                        sums[size] = 0
                        size += 1
                    if where[j] >= 0:
                        sums[where[j]] += factor * p_value[g]
        if used + size > columns.size:
            columns = np.concatenate((columns, np.empty(columns.size + size, np.int32)))
            values = np.concatenate((values, np.empty(values.size + size, np.float32)))
        for at in range(1, size):
            j, before = found[at], at
            while before > 0 and found[before - 1] > j:
                found[before] = found[before - 1]
                before -= 1
            found[before] = j
        for at in range(size):
            columns[used + at] = found[at]
            values[used + at] = sums[where[found[at]]]
            where[found[at]] = -1
        where[row] = -1
        used += size
        count[row + 1] = size
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
def multiply(start, column, value, x, out):
    """out = R x."""
    for i in prange(out.size):
        total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            total += value[e] * x[column[e]]
        out[i] = total


@njit(cache=True, parallel=True)
def multiply_add(start, column, value, x, out):
    """out += R x."""
    for i in prange(out.size):
        total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            total += value[e] * x[column[e]]
        out[i] += total


@njit(cache=True, parallel=True)
def _relax_from_zero(start, column, value, inverse, b, x, chunks):
    """A forward Gauss-Seidel sweep from x = 0, in each chunk by itself. Columns are in order."""
    size = b.size
    for part in prange(chunks):
        chunk = np.int64(part)  # numba's parallel indices are unsigned
        first, last = size * chunk // chunks, size * (chunk + 1) // chunks
        for i in range(first, last):
            total = b[i]
            for e in range(start[i], start[i + 1]):
                j = column[e]
                if j > i:
                    break
                if j >= first:
                    total += value[e] * x[j]
            x[i] = total * inverse[i]


@njit(cache=True, parallel=True)
def _residual_after(start, column, value, x, out, chunks):
    """What `_relax_from_zero` leaves: only the couplings it did not look at."""
    size = x.size
    for part in prange(chunks):
        chunk = np.int64(part)
        first, last = size * chunk // chunks, size * (chunk + 1) // chunks
        for i in range(first, last):
            total = np.float32(0)
            for e in range(start[i + 1] - 1, start[i] - 1, -1):
                j = column[e]
                if j < i:
                    break
                total += value[e] * x[j]
            for e in range(start[i], start[i + 1]):
                j = column[e]
                if j >= first:
                    break
                total += value[e] * x[j]
            out[i] = total


@njit(cache=True, parallel=True)
def _relax_back(start, column, value, inverse, b, x, old, chunks):
    """A backward Gauss-Seidel sweep; other chunks' unknowns count as they were before."""
    size = b.size
    for i in prange(size):
        old[i] = x[i]
    for part in prange(chunks):
        chunk = np.int64(part)
        first, last = size * chunk // chunks, size * (chunk + 1) // chunks
        for i in range(last - 1, first - 1, -1):
            total = b[i]
            for e in range(start[i], start[i + 1]):
                j = column[e]
                total += value[e] * (x[j] if first <= j < last else old[j])
            x[i] = total * inverse[i]

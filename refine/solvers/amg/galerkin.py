"""The next level of a hierarchy: interpolation from the coarse unknowns, and P' M P."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from refine.solvers.amg.cf_splitting import COARSE, FINE
from refine.solvers.amg.csr import Indices, Rows, of
from refine.solvers.stencil.operator import Singles


def interpolation(
    graph: Rows, diagonal: Singles, excess: Singles, ends: Indices, state: NDArray[np.int8]
) -> tuple[Rows, int]:
    """P for this splitting (`refine.solvers.amg.cf_splitting`), and the number of coarse unknowns."""
    number = np.cumsum(state == COARSE, dtype=np.int32) - np.int32(1)
    coarse = int(number[-1]) + 1
    start = np.zeros(state.size + 1, np.int32)
    _count_interpolation(graph.column, ends, state, start)
    np.cumsum(start, out=start)
    column, value = np.empty(start[-1], np.int32), np.empty(start[-1], np.float32)
    _fill_interpolation(
        graph.column, graph.value, diagonal, excess, ends, state, number, start, column, value
    )
    return Rows(start, column, value), coarse


@dataclass(frozen=True)
class Pieces:
    """Couplings by rows in parts, so that those of the level above need not be there when they are put together."""

    start: Indices
    columns: list[Indices]
    values: list[Singles]


def galerkin_pieces(
    graph: Rows,
    diagonal: Singles,
    excess: Singles,
    prolong: Rows,
    coarse: int,
    bounds: NDArray[np.int64],
) -> tuple[Pieces, Singles]:
    """P' M P as couplings and excess. The bounds say which of its rows are made side by side."""
    restrict = _transposed(prolong, coarse)
    start, next_excess = np.zeros(coarse + 1, np.int32), np.empty(coarse, np.float32)
    parent, share = np.empty(diagonal.size, np.uint32), np.empty(diagonal.size, np.float32)
    sums = np.empty(diagonal.size, np.float32)
    most = _first_entries(*of(prolong), np.uint32(coarse), parent, share, sums)
    pieces = _multiply(
        *_unsigned(graph), diagonal, excess, sums, parent, share, *_unsigned(prolong), most,
        *_unsigned(restrict), bounds, start, next_excess,
    )  # fmt: skip
    np.cumsum(start, out=start)
    columns, values = zip(*pieces, strict=True)
    return Pieces(start, list(columns), list(values)), next_excess


def joined(pieces: Pieces) -> Rows:
    """The couplings; the pieces are emptied."""
    column = np.concatenate(pieces.columns)
    pieces.columns.clear()
    value = np.concatenate(pieces.values)
    pieces.values.clear()
    return Rows(pieces.start, column, value)


def _transposed(rows: Rows, columns: int) -> Rows:
    start = np.zeros(columns + 1, np.int32)
    column, value = np.empty_like(rows.column), np.empty_like(rows.value)
    _transpose(*of(rows), start, column, value)
    return Rows(start, column, value)


@njit(cache=True, parallel=True)
def _count_interpolation(column, ends, state, count):
    for i in prange(state.size):
        if state[i] == COARSE:
            count[i + 1] = 1
        elif state[i] == FINE:
            for e in range(ends[0, i], ends[2, i]):
                count[i + 1] += state[column[e]] == COARSE


@njit(cache=True, parallel=True)
def _fill_interpolation(column, value, diagonal, excess, ends, state, number, place, into, weight):
    """Direct interpolation: the strong coarse neighbours stand for all neighbours."""
    for i in prange(state.size):
        at = place[i]
        if state[i] == COARSE:
            into[at] = number[i]
            weight[at] = 1
        elif state[i] == FINE:
            kept = np.float32(0)
            for e in range(ends[0, i], ends[2, i]):
                if state[column[e]] == COARSE:
                    kept += value[e]
                    into[at] = number[column[e]]
                    weight[at] = value[e]
                    at += 1
            for e in range(place[i], at):
                # Across a hard edge all couplings may be next to nothing, and kept * diagonal would underflow.
                weight[e] = weight[e] / kept * ((diagonal[i] - excess[i]) / diagonal[i])


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


def _unsigned(rows: Rows) -> tuple[NDArray[np.uint32], NDArray[np.uint32], Singles]:
    """For a kernel: an index that cannot be negative needs not be asked whether it counts from the end."""
    return rows.start.view(np.uint32), rows.column.view(np.uint32), rows.value


@njit(cache=True, parallel=True)
def _first_entries(start, column, value, none, parent, share, sums):
    """Of each row the first entry, (none, 0) where there is none, and the sum; the most entries in one."""
    most = 1
    for i in prange(sums.size):
        parent[i], share[i] = none, 0
        if start[i] < start[i + 1]:
            parent[i], share[i] = column[start[i]], value[start[i]]
        total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            total += value[e]
        sums[i] = total
        most = max(most, start[i + 1] - start[i])
    return most


@njit(cache=True)
def _add(j, amount, row, met, sums, columns, used):
    """sums[j] += amount; j is put at the end of the columns if the row has not met it, without a branch."""
    new = met[j] != row
    met[j] = row
    columns[used] = j
    sums[j] = (0.0 if new else sums[j]) + amount
    return used + new


@njit(cache=True)
def _rows(
    start, column, value, diagonal, excess, row_sums, parent, share, p_start, p_column, p_value, most,
    r_start, r_column, r_value, first, last, count, next_excess,
):  # fmt: skip
    """Rows first to last of P' M P without the diagonal, as couplings.

    Most rows of P have one entry: the first is taken without asking whether it is there.
    """
    one = np.uint32(1)
    columns = np.empty(12 * (last - first) + 64, np.int32)
    values = np.empty(columns.size, np.float32)
    met, sums = np.full(r_start.size, -1, np.int32), np.empty(r_start.size, np.float64)
    used = 0
    for row in range(first, last):
        before, needed = used, used
        for e in range(r_start[row], r_start[row + 1]):
            needed += (start[r_column[e] + one] - start[r_column[e]] + 1) * most
        if needed > columns.size:
            columns = np.concatenate((columns, np.empty(needed, np.int32)))
            values = np.concatenate((values, np.empty(needed, np.float32)))
        met[row] = met[r_start.size - 1] = row
        held = 0.0
        for e in range(r_start[row], r_start[row + 1]):
            i = r_column[e]
            out = np.float64(excess[i] * row_sums[i])
            for f in range(np.int64(start[i]) - 1, np.int64(start[i + one])):
                own = f < start[i]
                k = i if own else column[np.uint32(f)]
                coupling = -diagonal[i] if own else value[np.uint32(f)]
                out += coupling * (row_sums[i] - row_sums[k])  # P' M P 1, from differences
                coupling *= r_value[e]
                used = _add(parent[k], coupling * share[k], row, met, sums, columns, used)
                for g in range(p_start[k] + one, p_start[k + one]):
                    used = _add(p_column[g], coupling * p_value[g], row, met, sums, columns, used)
            held += r_value[e] * out
        next_excess[row] = held
        for at in range(before, used):
            values[at] = sums[columns[at]]
        count[row + 1] = used - before
    return columns[:used].copy(), values[:used].copy()


@njit(cache=True, parallel=True)
def _multiply(
    start, column, value, diagonal, excess, row_sums, parent, share, p_start, p_column, p_value, most,
    r_start, r_column, r_value, bounds, count, next_excess,
):  # fmt: skip
    empty = (np.empty(0, np.int32), np.empty(0, np.float32))
    pieces = [empty for _ in range(bounds.size - 1)]
    for part in prange(bounds.size - 1):
        pieces[part] = _rows(
            start, column, value, diagonal, excess, row_sums, parent, share, p_start, p_column, p_value, most,
            r_start, r_column, r_value, bounds[part], bounds[part + 1], count, next_excess,
        )  # fmt: skip
    return pieces

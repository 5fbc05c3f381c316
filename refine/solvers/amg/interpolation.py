"""Interpolation between a level and the next coarser one, and restriction, its transpose.

P has about one entry a row. Row by row, most of the time would go into finding where the rows end, so the cycle keeps
P as one list of entries (coordinate format), which serves both directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from refine.solvers.amg.cf_splitting import COARSE, FINE
from refine.solvers.amg.csr import CSRMatrix
from refine.solvers.amg.sell import SLICE_HEIGHT
from refine.solvers.arrays import Float32Array, IndexArray
from stereoforge_kit.kernels import njit, prange

_CHUNKS = 8


@dataclass(frozen=True)
class Interpolation:
    """The interpolation P in coordinate format."""

    fine: IndexArray
    """(entries) row of each entry: its place in the fine level's vectors."""
    coarse: IndexArray
    """(entries) column of each entry: its place in the coarse level's vectors."""
    weight: Float32Array
    """(entries)."""
    bounds: NDArray[np.int64]
    """Where the chunks of entries begin and end: no two chunks share a fine unknown, and only neighbouring ones share a
    coarse unknown."""

    def restrict(self, fine: Float32Array, out: Float32Array) -> None:
        """out = P' fine."""
        _restrict(self.fine, self.coarse, self.weight, self.bounds, fine, out)

    def prolong(self, coarse: Float32Array, out: Float32Array) -> None:
        """out += P coarse."""
        _prolong(self.fine, self.coarse, self.weight, self.bounds, coarse, out)


def direct_interpolation(
    couplings: CSRMatrix,
    diagonal: Float32Array,
    row_sum: Float32Array,
    strong_ends: IndexArray,
    state: NDArray[np.int8],
) -> tuple[CSRMatrix, int]:
    """Interpolate each fine unknown from the coarse ones that it depends on strongly, which stand for all its
    neighbours.

        P_ij = (w_ij / sum_k w_ik) (sum_l w_il / M_ii),   j and k coarse and strong for i, l any neighbour

    That is direct interpolation (K. Stueben, "An introduction to algebraic multigrid", in U. Trottenberg,
    C. W. Oosterlee, A. Schueller, Multigrid, Academic Press 2001, Sec. A.7.2).

    Args:
        couplings: Of the M-matrix, after `refine.solvers.amg.cf_splitting.sort_by_strength`.
        diagonal: (n) of the M-matrix.
        row_sum: (n) of the M-matrix.
        strong_ends: (3, n) from `sort_by_strength`.
        state: (n) from `refine.solvers.amg.cf_splitting.cf_splitting`.

    Returns:
        P, and the number of coarse unknowns.
    """
    number = np.cumsum(state == COARSE, dtype=np.int32) - np.int32(1)
    coarse_size = int(number[-1]) + 1
    indptr = np.zeros(state.size + 1, np.int32)
    _count_entries(couplings.indices, strong_ends, state, indptr)
    np.cumsum(indptr, out=indptr)
    indices, weight = np.empty(indptr[-1], np.int32), np.empty(indptr[-1], np.float32)
    _fill_entries(
        couplings.indices,
        couplings.data,
        diagonal,
        row_sum,
        strong_ends,
        state,
        number,
        indptr,
        indices,
        weight,
    )
    return CSRMatrix(indptr, indices, weight), coarse_size


def arrange_interpolation(
    interpolation: CSRMatrix, fine_position: IndexArray, coarse_position: IndexArray
) -> Interpolation:
    """Turn P from CSR into the format of the cycle.

    Args:
        interpolation: P.
        fine_position: (rows) place of each fine unknown in its level's vectors. Unknowns of one slice
            (`refine.solvers.amg.sell`) stay within it.
        coarse_position: (columns) the same for the coarse unknowns.
    """
    coarse = coarse_position[interpolation.indices]
    fine = np.repeat(fine_position, np.diff(interpolation.indptr))
    slices = -(-fine_position.size // SLICE_HEIGHT)
    ends = np.linspace(0, slices, _CHUNKS + 1).astype(np.int64) * SLICE_HEIGHT
    bounds = interpolation.indptr[np.minimum(ends, fine_position.size)].astype(np.int64)
    if not _only_neighbors_overlap(coarse, bounds):
        bounds = bounds[[0, -1]]
    return Interpolation(fine, coarse, interpolation.data, bounds)


def _only_neighbors_overlap(coarse: IndexArray, bounds: NDArray[np.int64]) -> bool:
    """Whether only neighbouring chunks share coarse unknowns."""
    chunks = [coarse[first:last] for first, last in pairwise(bounds) if last > first]
    if len(chunks) < _CHUNKS:
        return False
    highest = np.maximum.accumulate([chunk.max() for chunk in chunks])
    lowest = np.minimum.accumulate([chunk.min() for chunk in chunks][::-1])[::-1]
    return bool((highest[:-2] < lowest[2:]).all())


@njit(parallel=True)
def _count_entries(indices, strong_ends, state, count):
    for i in prange(state.size):
        if state[i] == COARSE:
            count[i + 1] = 1
        elif state[i] == FINE:
            for e in range(strong_ends[0, i], strong_ends[2, i]):
                count[i + 1] += state[indices[e]] == COARSE


@njit(parallel=True)
def _fill_entries(
    indices, data, diagonal, row_sum, strong_ends, state, number, p_indptr, p_indices, p_weight
):
    for i in prange(state.size):
        at = p_indptr[i]
        if state[i] == COARSE:
            p_indices[at] = number[i]
            p_weight[at] = 1
        elif state[i] == FINE:
            total = np.float32(0)
            for e in range(strong_ends[0, i], strong_ends[2, i]):
                if state[indices[e]] == COARSE:
                    total += data[e]
                    p_indices[at] = number[indices[e]]
                    p_weight[at] = data[e]
                    at += 1
            for e in range(p_indptr[i], at):
                # Across a hard edge all couplings may be next to nothing, and total * diagonal would underflow.
                p_weight[e] = p_weight[e] / total * ((diagonal[i] - row_sum[i]) / diagonal[i])


@njit()
def _add(target, source, weight, values, out, first, last):
    for e in range(first, last):
        out[target[e]] += weight[e] * values[source[e]]


@njit(parallel=True)
def _restrict(fine, coarse, weight, bounds, values, out):
    chunks = bounds.size - 1
    for j in prange(out.size):
        out[j] = 0
    # Neighbouring chunks write to the same coarse unknowns: first the even ones, then the odd ones.
    for pair in prange((chunks + 1) // 2):
        _add(coarse, fine, weight, values, out, bounds[2 * pair], bounds[2 * pair + 1])
    for pair in prange(chunks // 2):
        _add(coarse, fine, weight, values, out, bounds[2 * pair + 1], bounds[2 * pair + 2])


@njit(parallel=True)
def _prolong(fine, coarse, weight, bounds, values, out):
    for chunk in prange(bounds.size - 1):
        _add(fine, coarse, weight, values, out, bounds[chunk], bounds[chunk + 1])

"""C/F splitting: which unknowns of an M-matrix are coarse, by Ruge and Stueben's two passes.

J. W. Ruge and K. Stueben, "Algebraic multigrid", in S. F. McCormick (ed.), Multigrid Methods, SIAM 1987.
i depends strongly on j, and j influences i strongly, if w_ij is at least theta times the largest coupling of i.
"""

from __future__ import annotations

import numpy as np

from stereoforge_kit.kernels import njit, prange

UNDECIDED, FINE, COARSE, DIAGONALLY_DOMINANT = 0, 1, 2, 3
"""States of an unknown. `DIAGONALLY_DOMINANT`: fine and not interpolated, because the smoother alone settles it."""
_SMALLEST = np.float32(np.finfo(np.float32).smallest_subnormal)
"""A coupling has to be positive to be strong."""


@njit(parallel=True)
def sort_by_strength(indptr, indices, data, diagonal, theta, dominance):
    """Sort each row of couplings in place so that the strong ones come first; kernel.

    Two of seven couplings are strong on the first level, and the splitting looks at these only.

    Args:
        indptr: Of the couplings in CSR, like the next two.
        indices: Sorted.
        data: Sorted.
        diagonal: (n) of the M-matrix.
        theta: Strength threshold.
        dominance: A row is diagonally dominant if its couplings sum to this share of the diagonal or less; it then
            depends strongly on nothing (hypre's "max_row_sum").

    Returns:
        strong_ends: (3, n) ends of three groups in row i: first the j that depend strongly on i only, then those that
            depend on each other, then those that i depends on only. So i influences
            indptr[i]:strong_ends[1, i] and depends on strong_ends[0, i]:strong_ends[2, i].
        state: (n) `DIAGONALLY_DOMINANT` or `UNDECIDED`.
    """
    size = diagonal.size
    threshold = np.empty(size, np.float32)
    state = np.zeros(size, np.int8)
    strong_ends = np.empty((3, size), np.int32)
    for i in prange(size):
        largest = total = np.float32(0)
        for e in range(indptr[i], indptr[i + 1]):
            largest = max(largest, data[e])
            total += data[e]
        threshold[i] = max(theta * largest, _SMALLEST)
        if total <= dominance * diagonal[i]:
            state[i] = DIAGONALLY_DOMINANT
            threshold[i] = np.inf
    for i in prange(size):
        first = last = indptr[i]
        for e in range(first, indptr[i + 1]):
            if data[e] >= threshold[i] or data[e] >= threshold[indices[e]]:
                _swap(indices, data, e, last)
                last += 1
        strong_ends[2, i] = last
        for e in range(first, last):
            if data[e] < threshold[i]:
                _swap(indices, data, e, first)
                first += 1
        strong_ends[0, i] = first
        for e in range(first, last):
            if data[e] >= threshold[indices[e]]:
                _swap(indices, data, e, first)
                first += 1
        strong_ends[1, i] = first
    return strong_ends, state


@njit()
def _swap(indices, data, e, f):
    indices[e], indices[f] = indices[f], indices[e]
    data[e], data[f] = data[f], data[e]


@njit(parallel=True)
def cf_splitting(indptr, indices, strong_ends, state, bounds):
    """Decide for each unknown whether it is coarse or fine, by both passes; kernel.

    The second pass makes every two fine unknowns that are strongly coupled share a coarse one; without it the cycles
    converge several times more slowly. Both passes run on each chunk by itself, without the couplings to other
    chunks; then the second pass runs once more over the unknowns at the chunks' boundaries.

    Args:
        indptr: Of the couplings after `sort_by_strength`, like the next two.
        indices: Their columns.
        strong_ends: (3, n).
        state: (n), overwritten.
        bounds: Where the chunks begin and end.
    """
    size = state.size
    at_boundary = np.zeros(size, np.bool_)
    measure, marker = np.zeros(size, np.int32), np.full(size, -1, np.int32)
    following, preceding = np.empty(size, np.int32), np.empty(size, np.int32)
    for chunk in prange(bounds.size - 1):
        first, last = bounds[chunk], bounds[chunk + 1]
        _first_pass(indptr, indices, strong_ends, state, measure, following, preceding, first, last)
        for i in range(first, last):
            _second_pass(indices, strong_ends, state, marker, i, first, last)
            for e in range(strong_ends[0, i], strong_ends[2, i]):
                at_boundary[i] |= not first <= indices[e] < last
    for i in np.flatnonzero(at_boundary):
        _second_pass(indices, strong_ends, state, marker, i, 0, size)


@njit()
def _first_pass(indptr, indices, strong_ends, state, measure, following, preceding, first, last):
    """First pass over the unknowns from `first` up to `last` (Ruge and Stueben 1987, Algorithm A2).

    The measure of an undecided unknown is the number of undecided unknowns that depend strongly on it, plus two
    for each such unknown that is fine already. An unknown with the largest measure is the next coarse one. Undecided
    unknowns wait in buckets, one for each measure: doubly linked lists (`following`, `preceding`).
    """
    bucket = _fill_buckets(indptr, indices, strong_ends, state, measure, following, preceding, first, last)
    top = bucket.size - 1
    while top >= 0:
        i = bucket[top]
        if i < 0:
            top -= 1
            continue
        _remove(bucket, following, preceding, top, i)
        state[i] = COARSE
        # What depends on i becomes fine; what that depends on is worth more as a coarse unknown.
        for e in range(indptr[i], strong_ends[1, i]):
            j = indices[e]
            if not first <= j < last or state[j] != UNDECIDED:
                continue
            state[j] = FINE
            _remove(bucket, following, preceding, measure[j], j)
            for f in range(strong_ends[0, j], strong_ends[2, j]):
                k = indices[f]
                if first <= k < last and state[k] == UNDECIDED:
                    _move(bucket, following, preceding, measure, k, 1)
                    top = max(top, measure[k])
        # What i depends on no longer has i to interpolate to.
        for e in range(strong_ends[0, i], strong_ends[2, i]):
            j = indices[e]
            if first <= j < last and state[j] == UNDECIDED:
                _move(bucket, following, preceding, measure, j, -1)


@njit()
def _fill_buckets(indptr, indices, strong_ends, state, measure, following, preceding, first, last):
    """Set the initial measures and sort the undecided unknowns into buckets; the first unknown of each bucket, -1 for
    none."""
    most = 0
    for i in range(first, last):
        for e in range(indptr[i], strong_ends[1, i]):
            measure[i] += first <= indices[e] < last
        most = max(most, strong_ends[1, i] - indptr[i])
    bucket = np.full(2 * most + 2, -1, np.int32)
    for i in range(last - 1, first - 1, -1):
        if state[i] == UNDECIDED:
            _insert(bucket, following, preceding, measure[i], i)
    return bucket


@njit()
def _move(bucket, following, preceding, measure, i, change):
    """Change the measure of an unknown."""
    _remove(bucket, following, preceding, measure[i], i)
    measure[i] += change
    _insert(bucket, following, preceding, measure[i], i)


@njit()
def _insert(bucket, following, preceding, measure, i):
    following[i], preceding[i] = bucket[measure], -1
    if bucket[measure] >= 0:
        preceding[bucket[measure]] = i
    bucket[measure] = i


@njit()
def _remove(bucket, following, preceding, measure, i):
    if preceding[i] >= 0:
        following[preceding[i]] = following[i]
    else:
        bucket[measure] = following[i]
    if following[i] >= 0:
        preceding[following[i]] = preceding[i]


@njit()
def _second_pass(indices, strong_ends, state, marker, i, first, last):
    """Second pass for unknown i, among the unknowns from `first` up to `last` (Ruge and Stueben 1987, Algorithm A3).

    If i is fine, each fine j that it depends on must depend on a coarse unknown that i depends on as well. If one j
    does not, it becomes coarse; if a second one does not, i becomes coarse instead.
    """
    if state[i] != FINE:
        return
    for e in range(strong_ends[0, i], strong_ends[2, i]):
        j = indices[e]
        if first <= j < last and state[j] == COARSE:
            marker[j] = i
    tentative = -1
    for e in range(strong_ends[0, i], strong_ends[2, i]):
        j = indices[e]
        if not first <= j < last or state[j] != FINE:
            continue
        shared = False
        for f in range(strong_ends[0, j], strong_ends[2, j]):
            k = indices[f]
            if first <= k < last and marker[k] == i:
                shared = True
                break
        if not shared:
            if tentative >= 0:
                tentative = i
                break
            tentative = j
            marker[j] = i
    if tentative >= 0:
        state[tentative] = COARSE

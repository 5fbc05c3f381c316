"""Which unknowns of an M-matrix go on to the next level: Ruge and Stueben's two passes on compressed rows."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

UNDECIDED, FINE, COARSE, LOOSE = 0, 1, 2, 3
"""`LOOSE`: fine, and left to the smoother, because little ties it to others."""


@njit(cache=True, parallel=True)
def lead_with_strong(start, column, value, diagonal, strength, loose):
    """Put the strong couplings of each row first: two of seven on the first level, and nothing else looks at the
    others.

    Returns:
        ends, (3, size): a row begins with the couplings that are strong for the other unknown only, up to ends[0];
        then come those strong for both, up to ends[1]; then those for its own only, up to ends[2].
        state, (size): `LOOSE` or `UNDECIDED`.
    """
    size = diagonal.size
    threshold = np.empty(size, np.float32)
    state = np.zeros(size, np.int8)
    ends = np.empty((3, size), np.int32)
    for i in prange(size):
        largest = total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            largest = max(largest, value[e])
            total += value[e]
        threshold[i] = max(strength * largest, _SMALLEST)
        if total <= loose * diagonal[i]:
            state[i] = LOOSE
            threshold[i] = np.inf
    for i in prange(size):
        first = last = start[i]
        for e in range(first, start[i + 1]):
            if value[e] >= threshold[i] or value[e] >= threshold[column[e]]:
                _swap(column, value, e, last)
                last += 1
        ends[2, i] = last
        for e in range(first, last):
            if value[e] < threshold[i]:
                _swap(column, value, e, first)
                first += 1
        ends[0, i] = first
        for e in range(first, last):
            if value[e] >= threshold[column[e]]:
                _swap(column, value, e, first)
                first += 1
        ends[1, i] = first
    return ends, state


_SMALLEST = np.float32(np.finfo(np.float32).smallest_subnormal)
"""A coupling has to be positive to be strong."""


@njit(cache=True)
def _swap(column, value, e, f):
    column[e], column[f] = column[f], column[e]
    value[e], value[f] = value[f], value[e]


@njit(cache=True, parallel=True)
def split(start, column, ends, state, bounds):
    """Coarse and fine unknowns into `state`, by both passes of Ruge and Stueben 1987.

    The second sees to it that two fine unknowns with a strong coupling share a coarse one; without it the
    cycles converge several times slower. Both run in each chunk by itself, as if nothing were coupled across
    its bounds; then the second runs over what lies at the bounds.
    """
    size = state.size
    across = np.zeros(size, np.bool_)
    priority, seen = np.zeros(size, np.int32), np.full(size, -1, np.int32)
    after, before = np.empty(size, np.int32), np.empty(size, np.int32)
    for part in prange(bounds.size - 1):
        first, last = bounds[part], bounds[part + 1]
        _first_pass(start, column, ends, state, priority, after, before, first, last)
        for i in range(first, last):
            _second_pass(column, ends, state, seen, i, first, last)
            for e in range(ends[0, i], ends[2, i]):
                across[i] |= not first <= column[e] < last
    for i in np.flatnonzero(across):
        _second_pass(column, ends, state, seen, i, 0, size)


@njit(cache=True)
def _second_pass(column, ends, state, seen, i, first, last):
    """One step of the second pass, for i, with the unknowns from first to last only."""
    if state[i] != FINE:
        return
    for e in range(ends[0, i], ends[2, i]):
        j = column[e]
        if first <= j < last and state[j] == COARSE:
            seen[j] = i
    tentative = -1
    for e in range(ends[0, i], ends[2, i]):
        j = column[e]
        if not first <= j < last or state[j] != FINE:
            continue
        shared = False
        for f in range(ends[0, j], ends[2, j]):
            k = column[f]
            if first <= k < last and seen[k] == i:
                shared = True
                break
        if not shared:
            if tentative >= 0:
                tentative = i
                break
            tentative = j
            seen[j] = i
    if tentative >= 0:
        state[tentative] = COARSE


@njit(cache=True)
def _first_pass(start, column, ends, state, priority, after, before, first, last):
    """Ruge and Stueben's first pass from first to last: next comes whatever most unknowns would gladly
    interpolate from.

    Unknowns wait in doubly linked lists, one a priority: the number of undecided unknowns that depend on
    one strongly, plus two for each that is fine already.
    """
    most = 0
    for i in range(first, last):
        for e in range(start[i], ends[1, i]):
            priority[i] += first <= column[e] < last
        most = max(most, ends[1, i] - start[i])
    head = np.full(2 * most + 2, -1, np.int32)
    for i in range(last - 1, first - 1, -1):
        if state[i] == UNDECIDED:
            _insert(head, after, before, priority[i], i)
    top = head.size - 1
    while top >= 0:
        i = head[top]
        if i < 0:
            top -= 1
            continue
        _remove(head, after, before, top, i)
        state[i] = COARSE
        for e in range(start[i], ends[1, i]):
            j = column[e]
            if not first <= j < last or state[j] != UNDECIDED:
                continue
            state[j] = FINE
            _remove(head, after, before, priority[j], j)
            for f in range(ends[0, j], ends[2, j]):
                k = column[f]
                if first <= k < last and state[k] == UNDECIDED:
                    _remove(head, after, before, priority[k], k)
                    priority[k] += 1
                    _insert(head, after, before, priority[k], k)
                    top = max(top, priority[k])
        for e in range(ends[1, i], ends[2, i]):
            j = column[e]
            if first <= j < last and state[j] == UNDECIDED:
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

"""Which unknowns of an M-matrix go on to the next level: Ruge and Stueben's two passes on compressed rows."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

UNDECIDED, FINE, COARSE = 0, 1, 2


@njit(cache=True, parallel=True)
def split(start, column, value, diagonal, strength, loose, bounds):
    """Coarse and fine unknowns, by both passes of Ruge and Stueben 1987.

    The second sees to it that two fine unknowns with a strong coupling share a coarse one; without it the
    cycles converge several times slower. Both run in each chunk by itself, as if nothing were coupled across
    its bounds; then the second runs over what lies at the bounds.
    """
    size = diagonal.size
    threshold = np.empty(size, np.float32)
    state, across = np.zeros(size, np.int8), np.zeros(size, np.bool_)
    priority, seen = np.zeros(size, np.int32), np.full(size, -1, np.int32)
    after, before = np.full(size, -1, np.int32), np.full(size, -1, np.int32)
    for i in prange(size):
        largest = total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            largest = max(largest, value[e])
            total += value[e]
        threshold[i] = strength * largest
        if total <= loose * diagonal[i]:
            state[i] = FINE
            threshold[i] = np.inf
    for part in prange(bounds.size - 1):
        first, last = bounds[part], bounds[part + 1]
        _first_pass(start, column, value, threshold, state, priority, after, before, first, last)
        for i in range(first, last):
            _second_pass(start, column, value, threshold, state, seen, i, first, last)
            for e in range(start[i], start[i + 1]):
                across[i] |= not first <= column[e] < last
    for i in np.flatnonzero(across):
        _second_pass(start, column, value, threshold, state, seen, i, 0, size)
    return state, threshold


@njit(cache=True)
def _second_pass(start, column, value, threshold, state, seen, i, first, last):
    """One step of the second pass, for i, with the unknowns from first to last only."""
    if state[i] != FINE or threshold[i] == np.inf:
        return
    for e in range(start[i], start[i + 1]):
        j = column[e]
        if first <= j < last and state[j] == COARSE and value[e] >= threshold[i]:
            seen[j] = i
    tentative = -1
    for e in range(start[i], start[i + 1]):
        j = column[e]
        if not first <= j < last or state[j] != FINE or value[e] < threshold[i] or threshold[j] == np.inf:
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
        state[tentative] = COARSE


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
        for e in range(start[i], start[i + 1]):
            j = column[e]
            if not first <= j < last or state[j] != UNDECIDED:
                continue
            if value[e] >= threshold[j]:
                state[j] = FINE
                _remove(head, after, before, priority[j], j)
                for f in range(start[j], start[j + 1]):
                    k = column[f]
                    if first <= k < last and state[k] == UNDECIDED and value[f] >= threshold[j]:
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

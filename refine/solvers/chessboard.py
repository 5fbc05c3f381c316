"""The first coarsening: black pixels, as on a chessboard, eliminated from the M-matrix.

A black pixel's strongest couplings, those of the gradient term, all lead to red pixels. Two black pixels
diagonally next to each other are coupled by the colour term alone, and both lie beside the same two red pixels.
If one of the four couplings between them is far stronger, its two pixels are as good as one, and the pair's
coupling takes the detour over it: it is added to the coupling of the other black pixel and that red one. A
black pixel whose couplings to other black ones all take detours is eliminated, exactly and by a formula; red
pixels are left with couplings to the red ones diagonally next to them and two steps away. In smooth images half
of the work of choosing a coarse grid and of sparse products is thereby saved; in texture, where all couplings
are of one size, black pixels stay. Leaving weak couplings out instead, without the detour, takes up to five
times the iterations: across an edge they are all that holds one side to the other (docs/solver.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from refine.solvers.rows import Indices, Rows
from refine.solvers.stencils import Couplings, Singles

STRONGER = np.float32(3)
"""Times as strong as what it stands for, the coupling of a detour has to be."""
_LEAST = np.float32(1e-30)
"""What holds a black pixel by less than this is nothing: its inverse would overflow."""
_AROUND = np.array([(dy, dx) for dy in range(-2, 3) for dx in range(-2, 3) if 0 < abs(dy) + abs(dx) <= 2])
"""Where a pixel's couplings may lead after the elimination, in reading order."""


@dataclass(frozen=True)
class Elimination:
    """Between the image and the pixels that are left. All planes padded as those of the image."""

    ties: Singles
    """(2, H, W) the M-matrix's coupling to the right and downwards."""
    inverse: Singles
    """(H, W) 1 / diagonal at eliminated pixels, 0 elsewhere."""
    number: Indices
    """(H, W) of the pixels that are left, in reading order; -1 elsewhere."""

    def restrict(self, residual: Singles, out: Singles) -> None:
        """The right-hand side of the pixels that are left, for a residual of all."""
        _restrict(self.ties, self.inverse, self.number, residual, out)

    def prolong(self, left: Singles, residual: Singles, x: Singles) -> None:
        """Add to `x` the solution for this residual that is `left` on the pixels that are left."""
        _prolong(self.ties, self.inverse, self.number, left, residual, x)


def eliminate_black(parts: Couplings, color_scale: float) -> tuple[Elimination, Rows, Singles]:
    """The elimination, and couplings and excess (`refine.solvers.hierarchy`) of the pixels that are left.

    The M-matrix has data and gradient terms as they are, and for the colour term the graph Laplacian with
    couplings color_scale (color_p w_pq + color_q w_qp).
    """
    scale = np.float32(color_scale)
    ties, inverse = np.zeros_like(parts.axial), np.zeros_like(parts.tau)
    _tie(parts.weights, parts.color, parts.axial, scale, ties)
    loose, side = np.zeros_like(parts.tau), np.full(parts.tau.shape, _NOWHERE, np.int8)
    _detours(parts.weights, parts.color, scale, ties, loose, side)
    _take_over(loose, side, ties)
    _choose(parts.tau, ties, loose, inverse)
    number = np.full(parts.tau.shape, -1, np.int32)
    inside = number[2:-2, 2:-2]
    left = inverse[2:-2, 2:-2] == 0
    inside[left] = np.arange(np.count_nonzero(left), dtype=np.int32)
    start = np.zeros(np.count_nonzero(left) + 1, np.int32)
    _count(number, inverse, start)
    np.cumsum(start, out=start)
    column, value = np.empty(start[-1], np.int32), np.empty(start[-1], np.float32)
    excess = np.empty(start.size - 1, np.float32)
    _couple(
        parts.weights,
        parts.color,
        parts.tau,
        scale,
        ties,
        loose,
        inverse,
        number,
        start,
        column,
        value,
        excess,
    )
    return Elimination(ties, inverse, number), Rows(start, column, value), excess


@njit(cache=True, parallel=True)
def _tie(weights, color, axial, scale, ties):
    """Numbers of `NEIGHBORS`: 4 right, 3 left, 6 below, 1 above."""
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for y in prange(2, height + 2):
        for x in range(2, width + 2):
            across = color[y, x] * weights[4, y, x] + color[y, x + 1] * weights[3, y, x + 1]
            downwards = color[y, x] * weights[6, y, x] + color[y + 1, x] * weights[1, y + 1, x]
            ties[0, y, x] = scale * across + axial[0, y, x]
            ties[1, y, x] = scale * downwards + axial[1, y, x]


@njit(cache=True)
def _diagonal_tie(weights, color, scale, y, x, v, u):
    """The colour term's coupling of two pixels diagonally next to each other."""
    number = (v - y + 1) * 3 + u - x + 1
    number -= number > 4
    return scale * (color[y, x] * weights[number, y, x] + color[v, u] * weights[7 - number, v, u])


_TOP, _BOTTOM, _LEFT, _RIGHT, _NOWHERE = 0, 1, 2, 3, 4


@njit(cache=True)
def _detour(weights, color, scale, ties, y, x):
    """The coupling of the two black pixels among four, (y, x) upper left, and the side of the square that
    takes it over."""
    top, bottom = ties[0, y, x], ties[0, y + 1, x]
    left, right = ties[1, y, x], ties[1, y, x + 1]
    strongest = max(max(top, bottom), max(left, right))
    if (y + x) % 2 == 0:  # Black are the upper right and the lower left.
        tie = _diagonal_tie(weights, color, scale, y, x + 1, y + 1, x)
        after_top, after_bottom, after_left, after_right = _LEFT, _RIGHT, _TOP, _BOTTOM
    else:
        tie = _diagonal_tie(weights, color, scale, y, x, y + 1, x + 1)
        after_top, after_bottom, after_left, after_right = _RIGHT, _LEFT, _BOTTOM, _TOP
    if strongest < STRONGER * tie:
        return tie, _NOWHERE
    if strongest == top:
        return tie, after_top
    if strongest == bottom:
        return tie, after_bottom
    return tie, after_left if strongest == left else after_right


@njit(cache=True, parallel=True)
def _detours(weights, color, scale, ties, tie, side):
    for row in prange(tie.shape[0] - 5):
        y = np.int64(row) + 2  # numba's parallel indices are unsigned
        for x in range(2, tie.shape[1] - 3):
            tie[y, x], side[y, x] = _detour(weights, color, scale, ties, y, x)


@njit(cache=True, parallel=True)
def _take_over(tie, side, ties):
    """Add to each coupling what it takes over from the squares on its two sides; keep in `tie` the rest."""
    for row in prange(tie.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, tie.shape[1] - 2):
            for v, u, which, axis in (
                (y, x, _TOP, 0),
                (y - 1, x, _BOTTOM, 0),
                (y, x, _LEFT, 1),
                (y, x - 1, _RIGHT, 1),
            ):
                if side[v, u] == which:
                    ties[axis, y, x] += tie[v, u]
    for row in prange(tie.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, tie.shape[1] - 2):
            if side[y, x] != _NOWHERE:
                tie[y, x] = 0


@njit(cache=True, parallel=True)
def _choose(tau, ties, loose, inverse):
    """1 / diagonal at the black pixels that no other is coupled to: those to be eliminated."""
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for row in prange(height):
        y = np.int64(row) + 2
        for x in range(3 - y % 2, width + 2, 2):
            held = tau[y, x] + ties[0, y, x] + ties[0, y, x - 1] + ties[1, y, x] + ties[1, y - 1, x]
            alone = max(max(loose[y, x], loose[y, x - 1]), max(loose[y - 1, x], loose[y - 1, x - 1])) == 0
            if alone and held > _LEAST:
                inverse[y, x] = 1 / held


@njit(cache=True)
def _remains(number, inverse, y, x, v, u):
    """Whether the pixel (y, x), which is left, may be coupled to (v, u)."""
    if number[v, u] < 0:
        return False
    apart = abs(v - y) == 2 or abs(u - x) == 2
    return not apart or inverse[(y + v) // 2, (x + u) // 2] > 0


@njit(cache=True, parallel=True)
def _count(number, inverse, start):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, number.shape[1] - 2):
            if number[y, x] >= 0:
                count = 0
                for k in range(12):
                    count += _remains(number, inverse, y, x, y + _AROUND[k, 0], x + _AROUND[k, 1])
                start[number[y, x] + 1] = count


@njit(cache=True)
def _between(ties, y, x, v, u):
    """The coupling of two pixels side by side or one above the other."""
    return ties[0, y, min(x, u)] if y == v else ties[1, min(y, v), x]


@njit(cache=True)
def _through(ties, inverse, y, x, b, a, v, u):
    """The coupling of (y, x) and (v, u) through the pixel (b, a) beside both, if that is eliminated."""
    return _between(ties, y, x, b, a) * inverse[b, a] * _between(ties, b, a, v, u)


@njit(cache=True)
def _coupling(weights, color, scale, ties, loose, inverse, y, x, v, u):
    """Of two pixels that are left, after the elimination."""
    steps = abs(v - y) + abs(u - x)
    if steps == 1:
        return _between(ties, y, x, v, u)
    if y == v or x == u:
        return _through(ties, inverse, y, x, (y + v) // 2, (x + u) // 2, v, u)
    if (y + x) % 2 == 1:
        return loose[min(y, v), min(x, u)]
    around = _through(ties, inverse, y, x, y, u, v, u) + _through(ties, inverse, y, x, v, x, v, u)
    return around + _diagonal_tie(weights, color, scale, y, x, v, u)


@njit(cache=True)
def _gathered(ties, inverse, values, y, x):
    """What the eliminated pixels beside (y, x) pass on to it."""
    return (
        ties[0, y, x] * inverse[y, x + 1] * values[y, x + 1]
        + ties[0, y, x - 1] * inverse[y, x - 1] * values[y, x - 1]
        + ties[1, y, x] * inverse[y + 1, x] * values[y + 1, x]
        + ties[1, y - 1, x] * inverse[y - 1, x] * values[y - 1, x]
    )


@njit(cache=True, parallel=True)
def _couple(weights, color, tau, scale, ties, loose, inverse, number, start, column, value, excess):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, number.shape[1] - 2):
            here = number[y, x]
            if here < 0:
                continue
            at = start[here]
            for k in range(12):
                v, u = y + _AROUND[k, 0], x + _AROUND[k, 1]
                if _remains(number, inverse, y, x, v, u):
                    column[at] = number[v, u]
                    value[at] = _coupling(weights, color, scale, ties, loose, inverse, y, x, v, u)
                    at += 1
            excess[here] = tau[y, x] + _gathered(ties, inverse, tau, y, x)


@njit(cache=True, parallel=True)
def _restrict(ties, inverse, number, residual, out):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, number.shape[1] - 2):
            if number[y, x] >= 0:
                out[number[y, x]] = residual[y, x] + _gathered(ties, inverse, residual, y, x)


@njit(cache=True)
def _at(left, number, y, x):
    return left[number[y, x]] if number[y, x] >= 0 else np.float32(0)


@njit(cache=True, parallel=True)
def _prolong(ties, inverse, number, left, residual, x):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for j in range(2, number.shape[1] - 2):
            if number[y, j] >= 0:
                x[y, j] += left[number[y, j]]
            else:
                around = (
                    ties[0, y, j] * _at(left, number, y, j + 1)
                    + ties[0, y, j - 1] * _at(left, number, y, j - 1)
                    + ties[1, y, j] * _at(left, number, y + 1, j)
                    + ties[1, y - 1, j] * _at(left, number, y - 1, j)
                )
                x[y, j] += inverse[y, j] * (residual[y, j] + around)

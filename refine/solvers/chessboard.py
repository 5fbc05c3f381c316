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

from refine.solvers.hierarchy import Hierarchy, build_hierarchy
from refine.solvers.rows import Indices, Rows
from refine.solvers.stencils import Couplings, Singles
from refine.solvers.windows import DAMPING

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
    planes: Singles
    """(6, H, W) couplings of the pixels that are left to each other, by the last six of `_AROUND`."""

    def restrict(self, residual: Singles, out: Singles) -> None:
        """The right-hand side of the pixels that are left, for a residual of all. At the others `out` means
        nothing."""
        _restrict(self.ties, self.inverse, residual, out)

    def prolong(self, left: Singles, residual: Singles, x: Singles) -> None:
        """Add to `x` the solution for this residual that is `left` on the pixels that are left, 0 on the
        others."""
        _prolong(self.ties, self.inverse, left, residual, x)


@dataclass(frozen=True)
class GridSmoother:
    """`refine.solvers.hierarchy.Smoother` for the pixels that are left, without indices."""

    planes: Singles
    step: Singles
    """Flat, `DAMPING` / diagonal; 0 at pixels that are eliminated."""

    def from_zero(self, b: Singles, x: Singles, left: Singles) -> None:
        step, b, x, left = (vector.reshape(self.planes.shape[1:]) for vector in (self.step, b, x, left))
        _from_zero(self.planes, step, b, x, left)

    def again(self, b: Singles, x: Singles, out: Singles) -> None:
        step, b, x, out = (vector.reshape(self.planes.shape[1:]) for vector in (self.step, b, x, out))
        _again(self.planes, step, b, x, out)


def grid_hierarchy(elimination: Elimination, graph: Rows, excess: Singles) -> Hierarchy:
    """The hierarchy below the image for vectors that are padded images, flat."""

    def arrange(graph: Rows, excess: Singles) -> tuple[GridSmoother, Indices]:
        place = np.flatnonzero(elimination.number.ravel() >= 0).astype(np.int32)
        step = np.zeros_like(elimination.inverse)
        _invert(graph.start, graph.value, excess, place, step.ravel())
        return GridSmoother(elimination.planes, step.ravel()), place

    return build_hierarchy(graph, excess, arrange)


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
    planes = np.zeros((6, *number.shape), np.float32)
    _connect(parts.weights, parts.color, scale, ties, loose, inverse, planes)
    _count(planes, number, start)
    np.cumsum(start, out=start)
    column, value = np.empty(start[-1], np.int32), np.empty(start[-1], np.float32)
    excess = np.empty(start.size - 1, np.float32)
    _list(planes, number, start, column, value)
    _hold(parts.tau, ties, inverse, number, excess)
    return Elimination(ties, inverse, number, planes), Rows(start, column, value), excess


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


@njit(cache=True, parallel=True)
def _connect(weights, color, scale, ties, loose, inverse, planes):
    """What couples the pixels that are left, square by square, (y, x) upper left."""
    for row in prange(loose.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, loose.shape[1] - 2):
            top, bottom = ties[0, y, x], ties[0, y + 1, x]
            left, right = ties[1, y, x], ties[1, y, x + 1]
            planes[0, y, x] = top if max(inverse[y, x], inverse[y, x + 1]) == 0 else 0
            planes[3, y, x] = left if max(inverse[y, x], inverse[y + 1, x]) == 0 else 0
            planes[1, y, x] = top * inverse[y, x + 1] * ties[0, y, x + 1]
            planes[5, y, x] = left * inverse[y + 1, x] * ties[1, y + 1, x]
            if (y + x) % 2 == 0:  # Black are the upper right and the lower left.
                through = top * inverse[y, x + 1] * right + left * inverse[y + 1, x] * bottom
                planes[4, y, x] = through + _diagonal_tie(weights, color, scale, y, x, y + 1, x + 1)
                planes[2, y, x + 1] = loose[y, x]
            else:
                through = top * inverse[y, x] * left + right * inverse[y + 1, x + 1] * bottom
                planes[2, y, x + 1] = through + _diagonal_tie(weights, color, scale, y, x + 1, y + 1, x)
                planes[4, y, x] = loose[y, x]


@njit(cache=True)
def _coupling(planes, y, x, k):
    """Of the pixel (y, x) towards offset k of `_AROUND`."""
    return planes[k - 6, y, x] if k >= 6 else planes[5 - k, y + _AROUND[k, 0], x + _AROUND[k, 1]]


@njit(cache=True, parallel=True)
def _count(planes, number, start):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, number.shape[1] - 2):
            if number[y, x] >= 0:
                count = 0
                for k in range(12):
                    count += _coupling(planes, y, x, k) > 0
                start[number[y, x] + 1] = count


@njit(cache=True, parallel=True)
def _list(planes, number, start, column, value):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, number.shape[1] - 2):
            if number[y, x] >= 0:
                at = start[number[y, x]]
                for k in range(12):
                    strength = _coupling(planes, y, x, k)
                    if strength > 0:
                        column[at] = number[y + _AROUND[k, 0], x + _AROUND[k, 1]]
                        value[at] = strength
                        at += 1


@njit(cache=True, parallel=True)
def _invert(start, value, excess, place, step):
    """DAMPING / diagonal."""
    for i in prange(place.size):
        held = np.float64(excess[i])
        for e in range(start[i], start[i + 1]):
            held += value[e]
        step[place[i]] = DAMPING / np.float32(held) if held > 0 else 0


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
def _hold(tau, ties, inverse, number, excess):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, number.shape[1] - 2):
            if number[y, x] >= 0:
                excess[number[y, x]] = tau[y, x] + _gathered(ties, inverse, tau, y, x)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _restrict(ties, inverse, residual, out):
    height, width = residual.shape[0] - 4, residual.shape[1] - 4
    for y in prange(height):
        for x in range(width):
            out[y + 2, x + 2] = residual[y + 2, x + 2] + _gathered(ties, inverse, residual, y + 2, x + 2)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _prolong(ties, inverse, left, residual, x):
    height, width = residual.shape[0] - 4, residual.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            around = residual[y + 2, j + 2] + ties[0, y + 2, j + 2] * left[y + 2, j + 3]
            around += ties[0, y + 2, j + 1] * left[y + 2, j + 1]
            around += ties[1, y + 2, j + 2] * left[y + 3, j + 2] + ties[1, y + 1, j + 2] * left[y + 1, j + 2]
            x[y + 2, j + 2] += left[y + 2, j + 2] + inverse[y + 2, j + 2] * around


@njit(cache=True, fastmath={"contract"})
def _both(planes, k, x, y, j, dy, dx):
    """What the couplings k ahead and behind of (y + 2, j + 2) bring. Written as `j + 2 - dx`: indices that might be
    negative keep LLVM from vectorising."""
    ahead = planes[k, y + 2, j + 2] * x[y + 2 + dy, j + 2 + dx]
    return ahead + planes[k, y + 2 - dy, j + 2 - dx] * x[y + 2 - dy, j + 2 - dx]


@njit(cache=True, fastmath={"contract"})
def _coupled(planes, x, y, j):
    """The sum over the couplings of (y + 2, j + 2)."""
    total = _both(planes, 0, x, y, j, 0, 1) + _both(planes, 1, x, y, j, 0, 2)
    total += _both(planes, 2, x, y, j, 1, -1) + _both(planes, 3, x, y, j, 1, 0)
    return total + _both(planes, 4, x, y, j, 1, 1) + _both(planes, 5, x, y, j, 2, 0)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _from_zero(planes, step, b, x, left):
    height, width = step.shape[0] - 4, step.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            x[y + 2, j + 2] = step[y + 2, j + 2] * b[y + 2, j + 2]
    for y in prange(height):
        for j in range(width):
            left[y + 2, j + 2] = (1 - DAMPING) * b[y + 2, j + 2] + _coupled(planes, x, y, j)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _again(planes, step, b, x, out):
    height, width = step.shape[0] - 4, step.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            total = b[y + 2, j + 2] + _coupled(planes, x, y, j)
            out[y + 2, j + 2] = (1 - DAMPING) * x[y + 2, j + 2] + step[y + 2, j + 2] * total

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
from refine.solvers.linear import Problem
from refine.solvers.rows import Indices, Rows
from refine.solvers.stencils import Singles, bands, couplings_of
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

    tau: Singles
    """(H, W) the M-matrix's excess."""
    ties: Singles
    """(4, H, W) its couplings to the right, downwards, down right, and of the pixel to the right to the one below."""
    inverse: Singles
    """(H, W) 1 / diagonal at eliminated pixels, 0 elsewhere."""

    def restrict(self, residual: Singles, out: Singles) -> None:
        """The right-hand side of the pixels that are left, for a residual of all. At the others `out` means
        nothing."""
        _restrict(self.ties, self.inverse, residual, out)

    def prolong(self, left: Singles, residual: Singles, x: Singles) -> None:
        """Add to `x` the solution for this residual that is `left` on the pixels that are left."""
        _prolong(self.ties, self.inverse, left, residual, x)

    def graph(self) -> tuple[Rows, Singles, Indices]:
        """Couplings and excess (`refine.solvers.hierarchy`) of the pixels that are left, and which they are."""
        number = np.full(self.tau.shape, -1, np.int32)
        inside = number[2:-2, 2:-2]
        left = self.inverse[2:-2, 2:-2] == 0
        inside[left] = np.arange(np.count_nonzero(left), dtype=np.int32)
        start = np.zeros(np.count_nonzero(left) + 1, np.int32)
        planes = np.zeros((6, *number.shape), np.float32)
        _connect(self.ties, self.inverse, planes)
        _count(planes, number, start)
        np.cumsum(start, out=start)
        column, value = np.empty(start[-1], np.int32), np.empty(start[-1], np.float32)
        excess = np.empty(start.size - 1, np.float32)
        _list(planes, number, start, column, value)
        _hold(self.tau, self.ties, self.inverse, number, excess)
        return Rows(start, column, value), excess, np.flatnonzero(number >= 0).astype(np.int32)


@dataclass(frozen=True)
class GridSmoother:
    """`refine.solvers.hierarchy.Smoother` for the pixels that are left, without indices.

    Vectors are padded images, flat. At eliminated pixels they hold the solution for a residual of 0 there, so that
    what is left of the M-matrix is applied as the M-matrix itself.
    """

    elimination: Elimination
    step: Singles
    """`DAMPING` / diagonal; 0 at pixels that are eliminated."""

    def from_zero(self, b: Singles, x: Singles, left: Singles) -> None:
        of, shape = self.elimination, self.elimination.tau.shape
        step, b, x, left = (vector.reshape(shape) for vector in (self.step, b, x, left))
        _from_zero(of.tau, of.ties, of.inverse, step, b, x, left)

    def again(self, b: Singles, x: Singles, out: Singles) -> None:
        of, shape = self.elimination, self.elimination.tau.shape
        step, b, x, out = (vector.reshape(shape) for vector in (self.step, b, x, out))
        _again(of.tau, of.ties, of.inverse, step, b, x, out)


@dataclass(frozen=True)
class Coarsening:
    """All below the image."""

    elimination: Elimination
    hierarchy: Hierarchy
    """For vectors that are padded images, flat."""


def coarsen(problem: Problem, tau: Singles, color_scale: float) -> Coarsening:
    """The elimination and the hierarchy for a refinement's M-matrix (`eliminate_black`)."""
    elimination = eliminate_black(problem, tau, color_scale)
    return Coarsening(elimination, grid_hierarchy(elimination))


def grid_hierarchy(elimination: Elimination) -> Hierarchy:
    """The hierarchy below the image for vectors that are padded images, flat."""

    def arrange(graph: Rows, excess: Singles, place: Indices) -> GridSmoother:
        step = np.zeros(elimination.tau.size, np.float32)
        _invert(graph.start, graph.value, excess, place, step)
        return GridSmoother(elimination, step)

    return build_hierarchy(elimination.graph, arrange)


def eliminate_black(problem: Problem, tau: Singles, color_scale: float) -> Elimination:
    """The elimination from a refinement's M-matrix.

    That has data and gradient terms as they are, and for the colour term the graph Laplacian with couplings
    color_scale (color_p w_pq + color_q w_qp).
    """
    ties, inverse = np.zeros((4, *tau.shape), np.float32), np.zeros_like(tau)
    for first, last in bands(problem.shape[0]):
        parts = couplings_of(problem, first, last)
        _tie(parts.weights, parts.color, parts.axial, np.float32(color_scale), first, ties)
    side = np.full(tau.shape, _NOWHERE, np.int8)
    _detours(ties, side)
    _take_over(side, ties)
    _choose(tau, ties, inverse)
    return Elimination(tau, ties, inverse)


@njit(cache=True, parallel=True)
def _tie(weights, color, axial, scale, first, ties):
    """Numbers of `NEIGHBORS`: 4 right and 3 left, 6 below and 1 above, 7 and 0, 5 and 2."""
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for row in prange(height):
        y, to = row + 2, row + 2 + first
        for x in range(width):
            here, there = color[y, x + 2], color[y, x + 3]
            below, beyond = color[y + 1, x + 2], color[y + 1, x + 3]
            across = here * weights[4, y, x + 2] + there * weights[3, y, x + 3]
            downwards = here * weights[6, y, x + 2] + below * weights[1, y + 1, x + 2]
            ties[0, to, x + 2] = scale * across + axial[0, y, x + 2]
            ties[1, to, x + 2] = scale * downwards + axial[1, y, x + 2]
            ties[2, to, x + 2] = scale * (here * weights[7, y, x + 2] + beyond * weights[0, y + 1, x + 3])
            ties[3, to, x + 2] = scale * (there * weights[5, y, x + 3] + below * weights[2, y + 1, x + 2])


_TOP, _BOTTOM, _LEFT, _RIGHT, _NOWHERE = 0, 1, 2, 3, 4


@njit(cache=True)
def _detour(ties, y, x):
    """The side of the square, (y, x) upper left, that takes over the coupling of the two black pixels in it."""
    top, bottom = ties[0, y, x], ties[0, y + 1, x]
    left, right = ties[1, y, x], ties[1, y, x + 1]
    strongest = max(max(top, bottom), max(left, right))
    if (y + x) % 2 == 0:  # Black are the upper right and the lower left.
        tie = ties[3, y, x]
        after_top, after_bottom, after_left, after_right = _LEFT, _RIGHT, _TOP, _BOTTOM
    else:
        tie = ties[2, y, x]
        after_top, after_bottom, after_left, after_right = _RIGHT, _LEFT, _BOTTOM, _TOP
    if strongest < STRONGER * tie:
        return _NOWHERE
    if strongest == top:
        return after_top
    if strongest == bottom:
        return after_bottom
    return after_left if strongest == left else after_right


@njit(cache=True, parallel=True)
def _detours(ties, side):
    for row in prange(side.shape[0] - 5):
        y = np.int64(row) + 2  # numba's parallel indices are unsigned
        for x in range(2, side.shape[1] - 3):
            side[y, x] = _detour(ties, y, x)


@njit(cache=True, parallel=True)
def _take_over(side, ties):
    """Add to each coupling what it takes over from the squares on its two sides, which have it no more."""
    for row in prange(side.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, side.shape[1] - 2):
            for v, u, which, axis in (
                (y, x, _TOP, 0),
                (y - 1, x, _BOTTOM, 0),
                (y, x, _LEFT, 1),
                (y, x - 1, _RIGHT, 1),
            ):
                if side[v, u] == which:
                    ties[axis, y, x] += ties[3 - (v + u) % 2, v, u]
    for row in prange(side.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, side.shape[1] - 2):
            if side[y, x] != _NOWHERE:
                ties[3 - (y + x) % 2, y, x] = 0


@njit(cache=True, parallel=True)
def _choose(tau, ties, inverse):
    """1 / diagonal at the black pixels that no other is coupled to: those to be eliminated."""
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for row in prange(height):
        y = np.int64(row) + 2
        for x in range(3 - y % 2, width + 2, 2):
            held = tau[y, x] + ties[0, y, x] + ties[0, y, x - 1] + ties[1, y, x] + ties[1, y - 1, x]
            diagonal = max(
                max(ties[2, y, x], ties[2, y - 1, x - 1]), max(ties[3, y, x - 1], ties[3, y - 1, x])
            )
            if diagonal == 0 and held > _LEAST:
                inverse[y, x] = 1 / held


@njit(cache=True, parallel=True)
def _connect(ties, inverse, planes):
    """What couples the pixels that are left, square by square, (y, x) upper left."""
    for row in prange(inverse.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, inverse.shape[1] - 2):
            top, bottom = ties[0, y, x], ties[0, y + 1, x]
            left, right = ties[1, y, x], ties[1, y, x + 1]
            planes[0, y, x] = top if max(inverse[y, x], inverse[y, x + 1]) == 0 else 0
            planes[3, y, x] = left if max(inverse[y, x], inverse[y + 1, x]) == 0 else 0
            planes[1, y, x] = top * inverse[y, x + 1] * ties[0, y, x + 1]
            planes[5, y, x] = left * inverse[y + 1, x] * ties[1, y + 1, x]
            planes[4, y, x], planes[2, y, x + 1] = ties[2, y, x], ties[3, y, x]
            if (y + x) % 2 == 0:  # Black are the upper right and the lower left.
                planes[4, y, x] += top * inverse[y, x + 1] * right + left * inverse[y + 1, x] * bottom
            else:
                planes[2, y, x + 1] += top * inverse[y, x] * left + right * inverse[y + 1, x + 1] * bottom


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


@njit(cache=True, fastmath={"contract"})
def _beside(ties, x, y, j):
    """The sum over the couplings of (y + 2, j + 2) to the four pixels beside it. Written with `y + 2 - 1`: an index
    that may be negative keeps LLVM from vectorising."""
    total = ties[0, y + 2, j + 2] * x[y + 2, j + 3] + ties[0, y + 2, j + 1] * x[y + 2, j + 1]
    return total + ties[1, y + 2, j + 2] * x[y + 3, j + 2] + ties[1, y + 1, j + 2] * x[y + 1, j + 2]


@njit(cache=True, parallel=True, fastmath={"contract"})
def _prolong(ties, inverse, left, residual, x):
    height, width = residual.shape[0] - 4, residual.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            held = inverse[y + 2, j + 2]
            through = held * (residual[y + 2, j + 2] + _beside(ties, left, y, j))
            x[y + 2, j + 2] += left[y + 2, j + 2] if held == 0 else through


@njit(cache=True, fastmath={"contract"})
def _fill_row(ties, inverse, x, y):
    """Put in what eliminated pixels have for a residual of 0. They lie between pixels that are left only."""
    for j in range(inverse.shape[1] - 4):
        held = inverse[y + 2, j + 2]
        x[y + 2, j + 2] = x[y + 2, j + 2] if held == 0 else held * _beside(ties, x, y, j)


@njit(cache=True, fastmath={"contract"})
def _remainder(tau, ties, b, x, y, j):
    """b - M x at (y + 2, j + 2), from differences."""
    c = x[y + 2, j + 2]
    total = b[y + 2, j + 2] - tau[y + 2, j + 2] * c
    total += ties[0, y + 2, j + 2] * (x[y + 2, j + 3] - c) + ties[0, y + 2, j + 1] * (x[y + 2, j + 1] - c)
    total += ties[1, y + 2, j + 2] * (x[y + 3, j + 2] - c) + ties[1, y + 1, j + 2] * (x[y + 1, j + 2] - c)
    total += ties[2, y + 2, j + 2] * (x[y + 3, j + 3] - c) + ties[2, y + 1, j + 1] * (x[y + 1, j + 1] - c)
    return (
        total + ties[3, y + 2, j + 1] * (x[y + 3, j + 1] - c) + ties[3, y + 1, j + 2] * (x[y + 1, j + 3] - c)
    )


@njit(cache=True, parallel=True, fastmath={"contract"})
def _from_zero(tau, ties, inverse, step, b, x, left):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            x[y + 2, j + 2] = step[y + 2, j + 2] * b[y + 2, j + 2]
    for y in prange(height):
        _fill_row(ties, inverse, x, y)
    for y in prange(height):
        for j in range(width):
            left[y + 2, j + 2] = _remainder(tau, ties, b, x, y, j)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _again(tau, ties, inverse, step, b, x, out):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        _fill_row(ties, inverse, x, y)
    for y in prange(height):
        for j in range(width):
            out[y + 2, j + 2] = x[y + 2, j + 2] + step[y + 2, j + 2] * _remainder(tau, ties, b, x, y, j)

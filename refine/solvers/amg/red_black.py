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

from refine.solvers.amg.csr import Indices, Rows
from refine.solvers.amg.hierarchy import Hierarchy, build_hierarchy
from refine.solvers.amg.sell import DAMPING
from refine.solvers.bfloat16 import Halves, halves, widened
from refine.solvers.stencil.operator import MARGIN, CouplingRows, Singles, bands

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
    ties: Halves
    """(4, H, W) its couplings to the right, downwards, down right, and of the pixel to the right to the one below,
    in bfloat16 (`refine.solvers.bfloat16`): all below is made of the rounded ones."""
    relax: Singles
    """(H, W) 1 / diagonal at eliminated pixels. At the others minus `DAMPING` / diagonal of what is left, once that
    is known, and 0 before."""

    def restrict(self, residual: Singles, out: Singles) -> None:
        """The right-hand side of the pixels that are left, for a residual of all. At the others `out` means
        nothing."""
        _restrict(self.ties, self.relax, residual, out)

    def prolong(self, left: Singles, residual: Singles, x: Singles) -> None:
        """Add to `x` the solution for this residual that is `left` on the pixels that are left."""
        _prolong(self.ties, self.relax, left, residual, x)

    def graph(self) -> tuple[Rows, Singles, Indices]:
        """Couplings and excess (`refine.solvers.amg.hierarchy`) of the pixels that are left, and which they are."""
        number = np.full(self.tau.shape, -1, np.int32)
        inside = number[2:-2, 2:-2]
        left = self.relax[2:-2, 2:-2] <= 0
        inside[left] = np.arange(np.count_nonzero(left), dtype=np.int32)
        start = np.zeros(np.count_nonzero(left) + 1, np.int32)
        planes = np.zeros((6, *number.shape), np.float32)
        _connect(self.ties, self.relax, planes)
        _count(planes, number, start)
        np.cumsum(start, out=start)
        column, value = np.empty(start[-1], np.int32), np.empty(start[-1], np.float32)
        excess = np.empty(start.size - 1, np.float32)
        _list(planes, number, start, column, value)
        _hold(self.tau, self.ties, self.relax, number, excess)
        return Rows(start, column, value), excess, np.flatnonzero(number >= 0).astype(np.int32)


@dataclass(frozen=True)
class GridSmoother:
    """`refine.solvers.amg.hierarchy.Smoother` for the pixels that are left, without indices.

    Vectors are padded images, flat. At eliminated pixels they hold the solution for a residual of 0 there, so that
    what is left of the M-matrix is applied as the M-matrix itself.
    """

    elimination: Elimination

    @property
    def size(self) -> int:
        return self.elimination.tau.size

    def from_zero(self, b: Singles, x: Singles, left: Singles) -> None:
        of, shape = self.elimination, self.elimination.tau.shape
        _from_zero(of.tau, of.ties, of.relax, b.reshape(shape), x.reshape(shape), left.reshape(shape))

    def again(self, b: Singles, x: Singles, out: Singles) -> None:
        of, shape = self.elimination, self.elimination.tau.shape
        _again(of.tau, of.ties, of.relax, b.reshape(shape), x.reshape(shape), out.reshape(shape))


@dataclass(frozen=True)
class Coarsening:
    """All below the image."""

    elimination: Elimination
    hierarchy: Hierarchy
    """For vectors that are padded images, flat."""


def coarsen(tau: Singles, couplings: CouplingRows, color_scale: float) -> Coarsening:
    """The elimination and the hierarchy for a refinement's M-matrix (`eliminate_black`)."""
    elimination = eliminate_black(tau, couplings, color_scale)
    return Coarsening(elimination, grid_hierarchy(elimination))


def grid_hierarchy(elimination: Elimination) -> Hierarchy:
    """The hierarchy below the image for vectors that are padded images, flat."""

    def arrange(graph: Rows, excess: Singles, place: Indices) -> GridSmoother:
        _invert(graph.start, graph.value, excess, place, elimination.relax.ravel())
        return GridSmoother(elimination)

    return build_hierarchy(elimination.graph, arrange)


def eliminate_black(tau: Singles, couplings: CouplingRows, color_scale: float) -> Elimination:
    """The elimination from a refinement's M-matrix, for a padded tau.

    That has data and gradient terms as they are, and for the colour term the graph Laplacian with couplings
    color_scale (color_p w_pq + color_q w_qp).
    """
    ties = np.zeros((4, *tau.shape), np.float32)
    for first, last in bands(tau.shape[0] - 2 * MARGIN):
        parts = couplings(first, last)
        _tie(parts.weights, parts.color, parts.axial, np.float32(color_scale), first, ties)
    side = np.full(tau.shape, _NOWHERE, np.int8)
    _detours(ties, side)
    _take_over(side, ties)
    rounded, relax = halves(ties), np.zeros_like(tau)
    _choose(tau, rounded, relax)
    return Elimination(tau, rounded, relax)


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
def _choose(tau, ties, relax):
    """1 / diagonal at the black pixels that no other is coupled to: those to be eliminated."""
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for row in prange(height):
        y = np.int64(row) + 2
        for x in range(3 - y % 2, width + 2, 2):
            held = tau[y, x] + widened(ties[0, y, x]) + widened(ties[0, y, x - 1])
            held += widened(ties[1, y, x]) + widened(ties[1, y - 1, x])
            diagonal = ties[2, y, x] | ties[2, y - 1, x - 1] | ties[3, y, x - 1] | ties[3, y - 1, x]
            if diagonal == 0 and held > _LEAST:
                relax[y, x] = 1 / held


@njit(cache=True, parallel=True)
def _connect(ties, relax, planes):
    """What couples the pixels that are left, square by square, (y, x) upper left."""
    none = np.float32(0)
    for row in prange(relax.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, relax.shape[1] - 2):
            top, bottom = widened(ties[0, y, x]), widened(ties[0, y + 1, x])
            left, right = widened(ties[1, y, x]), widened(ties[1, y, x + 1])
            here, beside = max(relax[y, x], none), max(relax[y, x + 1], none)
            below, beyond = max(relax[y + 1, x], none), max(relax[y + 1, x + 1], none)
            planes[0, y, x] = top if max(here, beside) == 0 else none
            planes[3, y, x] = left if max(here, below) == 0 else none
            planes[1, y, x] = top * beside * widened(ties[0, y, x + 1])
            planes[5, y, x] = left * below * widened(ties[1, y + 1, x])
            planes[4, y, x], planes[2, y, x + 1] = widened(ties[2, y, x]), widened(ties[3, y, x])
            if (y + x) % 2 == 0:  # Black are the upper right and the lower left.
                planes[4, y, x] += top * beside * right + left * below * bottom
            else:
                planes[2, y, x + 1] += top * here * left + right * beyond * bottom


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
def _invert(start, value, excess, place, relax):
    """-DAMPING / diagonal."""
    for i in prange(place.size):
        held = np.float64(excess[i])
        for e in range(start[i], start[i + 1]):
            held += value[e]
        relax[place[i]] = -DAMPING / np.float32(held) if held > 0 else 0


# Below, a pixel is (y + 2, j + 2): an index like `j - 1` may be negative for all that LLVM knows, and keeps it from
# vectorising.


@njit(cache=True, fastmath={"contract"})
def _gathered(ties, relax, values, y, j):
    """What the eliminated pixels beside a pixel pass on to it."""
    none = np.float32(0)
    across = widened(ties[0, y + 2, j + 2]) * max(relax[y + 2, j + 3], none) * values[y + 2, j + 3]
    across += widened(ties[0, y + 2, j + 1]) * max(relax[y + 2, j + 1], none) * values[y + 2, j + 1]
    down = widened(ties[1, y + 2, j + 2]) * max(relax[y + 3, j + 2], none) * values[y + 3, j + 2]
    down += widened(ties[1, y + 1, j + 2]) * max(relax[y + 1, j + 2], none) * values[y + 1, j + 2]
    return across + down


@njit(cache=True, parallel=True)
def _hold(tau, ties, relax, number, excess):
    for y in prange(number.shape[0] - 4):
        for x in range(number.shape[1] - 4):
            if number[y + 2, x + 2] >= 0:
                excess[number[y + 2, x + 2]] = tau[y + 2, x + 2] + _gathered(ties, relax, tau, y, x)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _restrict(ties, relax, residual, out):
    height, width = residual.shape[0] - 4, residual.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            out[y + 2, j + 2] = residual[y + 2, j + 2] + _gathered(ties, relax, residual, y, j)


@njit(cache=True, fastmath={"contract"})
def _beside(ties, x, y, j):
    """The sum over a pixel's couplings to the four beside it."""
    total = (
        widened(ties[0, y + 2, j + 2]) * x[y + 2, j + 3] + widened(ties[0, y + 2, j + 1]) * x[y + 2, j + 1]
    )
    total += widened(ties[1, y + 2, j + 2]) * x[y + 3, j + 2]
    return total + widened(ties[1, y + 1, j + 2]) * x[y + 1, j + 2]


@njit(cache=True, parallel=True, fastmath={"contract"})
def _prolong(ties, relax, left, residual, x):
    height, width = residual.shape[0] - 4, residual.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            held = relax[y + 2, j + 2]
            through = held * (residual[y + 2, j + 2] + _beside(ties, left, y, j))
            x[y + 2, j + 2] += through if held > 0 else left[y + 2, j + 2]


@njit(cache=True, parallel=True, fastmath={"contract"})
def _fill(ties, relax, x):
    """Put in what eliminated pixels have for a residual of 0. They lie between pixels that are left only, so none
    reads what is put in here."""
    height, width = relax.shape[0] - 4, relax.shape[1] - 4
    for y in prange(height):
        row = np.empty(width, np.float32)
        for j in range(width):
            held = relax[y + 2, j + 2]
            row[j] = held * _beside(ties, x, y, j) if held > 0 else x[y + 2, j + 2]
        x[y + 2, 2:-2] = row


@njit(cache=True, fastmath={"contract"})
def _remainder(tau, ties, b, x, y, j):
    """b - M x, from differences."""
    c = x[y + 2, j + 2]
    total = b[y + 2, j + 2] - tau[y + 2, j + 2] * c
    total += widened(ties[0, y + 2, j + 2]) * (x[y + 2, j + 3] - c)
    total += widened(ties[0, y + 2, j + 1]) * (x[y + 2, j + 1] - c)
    total += widened(ties[1, y + 2, j + 2]) * (x[y + 3, j + 2] - c)
    total += widened(ties[1, y + 1, j + 2]) * (x[y + 1, j + 2] - c)
    total += widened(ties[2, y + 2, j + 2]) * (x[y + 3, j + 3] - c)
    total += widened(ties[2, y + 1, j + 1]) * (x[y + 1, j + 1] - c)
    total += widened(ties[3, y + 2, j + 1]) * (x[y + 3, j + 1] - c)
    return total + widened(ties[3, y + 1, j + 2]) * (x[y + 1, j + 3] - c)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _from_zero(tau, ties, relax, b, x, left):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            x[y + 2, j + 2] = min(relax[y + 2, j + 2], np.float32(0)) * -b[y + 2, j + 2]
    _fill(ties, relax, x)
    for y in prange(height):
        for j in range(width):
            left[y + 2, j + 2] = _remainder(tau, ties, b, x, y, j)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _again(tau, ties, relax, b, x, out):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    _fill(ties, relax, x)
    for y in prange(height):
        for j in range(width):
            step = min(relax[y + 2, j + 2], np.float32(0))
            out[y + 2, j + 2] = x[y + 2, j + 2] - step * _remainder(tau, ties, b, x, y, j)

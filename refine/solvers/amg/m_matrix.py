"""The 9-point M-matrix that stands for A below the image, ready for red-black reduction.

It has the data and gradient terms of A as they are. For the colour term beta L' Phibar L, a squared Laplacian on which
algebraic coarsening fails, it has the graph Laplacian with couplings c (color_p w_pq + color_q w_qp).

The couplings between diagonal neighbours, of one colour in the red-black ordering, come from the colour term alone. Two
black pixels that are diagonal neighbours both lie beside the same two red pixels. If one of the four couplings between
them is far stronger than that of the two black pixels, its red and its black pixel are as good as one. Then the
black-black coupling is removed and compensated for: it is added to the coupling of that red pixel and the other black
one (sparsify and compensate: D. Krishnan, R. Fattal, R. Szeliski, "Efficient preconditioning of Laplacian matrices for
computer graphics", ACM Trans. Graph. 32 (4), 2013). Removing weak couplings without compensation takes up to five times
the iterations: across an edge they are all that holds one side to the other (docs/solver.md).
"""

from __future__ import annotations

import numpy as np

from refine.solvers.arrays import Float32Array
from refine.solvers.stencil.padding import MARGIN, row_bands
from refine.solvers.stencil.weights import BandWeights
from stereoforge_kit.kernels import njit, prange

COMPENSATION_RATIO = np.float32(3)
"""How many times as strong as a black-black coupling the strongest one beside it must be."""
_TOP, _BOTTOM, _LEFT, _RIGHT, _NONE = 0, 1, 2, 3, 4
"""Sides of a square of four pixels."""


def assemble_m_matrix(tau: Float32Array, weights: BandWeights, color_scale: float) -> Float32Array:
    """Assemble the M-matrix, with black-black couplings removed where that can be compensated for.

    Args:
        tau: (H, W) its row sums, padded.
        weights: Called once for each band of rows, from top to bottom.
        color_scale: c, the share of the colour term's couplings.

    Returns:
        (4, H, W) couplings, padded: of each pixel to the right, downwards and down right; and of the pixel to its
        right with the one below it.
    """
    couplings = np.zeros((4, *tau.shape), np.float32)
    for first, last in row_bands(tau.shape[0] - 2 * MARGIN):
        band = weights(first, last)
        _assemble(band.neighbors, band.color, band.gradient, np.float32(color_scale), first, couplings)
    side = np.full(tau.shape, _NONE, np.int8)
    _choose_sides(couplings, side)
    _compensate(side, couplings)
    return couplings


@njit(parallel=True)
def _assemble(neighbors, color, gradient, scale, first, w):
    """Couplings of a band of rows. Opposite neighbours have the numbers 4 and 3, 6 and 1, 7 and 0, 5 and 2 in
    `refine.energy.affinity.NEIGHBORS`."""
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for row in prange(height):
        y, to = row + 2, row + 2 + first
        for x in range(width):
            here, there = color[y, x + 2], color[y, x + 3]
            below, beyond = color[y + 1, x + 2], color[y + 1, x + 3]
            across = here * neighbors[4, y, x + 2] + there * neighbors[3, y, x + 3]
            downwards = here * neighbors[6, y, x + 2] + below * neighbors[1, y + 1, x + 2]
            w[0, to, x + 2] = scale * across + gradient[0, y, x + 2]
            w[1, to, x + 2] = scale * downwards + gradient[1, y, x + 2]
            w[2, to, x + 2] = scale * (here * neighbors[7, y, x + 2] + beyond * neighbors[0, y + 1, x + 3])
            w[3, to, x + 2] = scale * (there * neighbors[5, y, x + 3] + below * neighbors[2, y + 1, x + 2])


@njit()
def _compensating_side(w, y, x):
    """Which side of a square with (y, x) at its upper left takes over the coupling of its two black pixels."""
    top, bottom = w[0, y, x], w[0, y + 1, x]
    left, right = w[1, y, x], w[1, y, x + 1]
    strongest = max(max(top, bottom), max(left, right))
    if (y + x) % 2 == 0:  # Black are the upper right and the lower left.
        coupling = w[3, y, x]
        after_top, after_bottom, after_left, after_right = _LEFT, _RIGHT, _TOP, _BOTTOM
    else:
        coupling = w[2, y, x]
        after_top, after_bottom, after_left, after_right = _RIGHT, _LEFT, _BOTTOM, _TOP
    if strongest < COMPENSATION_RATIO * coupling:
        return _NONE
    if strongest == top:
        return after_top
    if strongest == bottom:
        return after_bottom
    return after_left if strongest == left else after_right


@njit(parallel=True)
def _choose_sides(w, side):
    for row in prange(side.shape[0] - 5):
        y = np.int64(row) + 2  # numba's parallel indices are unsigned
        for x in range(2, side.shape[1] - 3):
            side[y, x] = _compensating_side(w, y, x)


@njit(parallel=True)
def _compensate(side, w):
    """Add to each coupling what it takes over from the squares on its two sides, then remove it there."""
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
                    w[axis, y, x] += w[3 - (v + u) % 2, v, u]
    for row in prange(side.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, side.shape[1] - 2):
            if side[y, x] != _NONE:
                w[3 - (y + x) % 2, y, x] = 0

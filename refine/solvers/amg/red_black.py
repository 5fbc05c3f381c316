"""Red-black reduction, the first coarsening: black pixels are eliminated from the M-matrix.

A black pixel without couplings to other black ones (`refine.solvers.amg.m_matrix` removes as many as it can) is
eliminated exactly, by a formula. The Schur complement couples the remaining pixels with their diagonal neighbours and
with those two steps away. In smooth images that saves half of the C/F splitting and of the Galerkin products; in
texture, where all couplings are of one size, black pixels remain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from refine.solvers.amg.csr import CSRMatrix
from refine.solvers.amg.hierarchy import Hierarchy, build_hierarchy
from refine.solvers.amg.m_matrix import assemble_m_matrix
from refine.solvers.amg.sell import DAMPING
from refine.solvers.arrays import Float32Array, IndexArray
from refine.solvers.bfloat16 import BFloat16Array, round_to_bfloat16, to_float32
from refine.solvers.stencil.weights import BandWeights
from stereoforge_kit.kernels import njit, prange

_SMALLEST_DIAGONAL = np.float32(1e-30)
"""A black pixel with a smaller diagonal is not eliminated: its inverse would overflow."""
_REDUCED_STENCIL = np.array(
    [(dy, dx) for dy in range(-2, 3) for dx in range(-2, 3) if 0 < abs(dy) + abs(dx) <= 2]
)
"""Where couplings may lead after the reduction, in reading order."""


@dataclass(frozen=True)
class RedBlackReduction:
    """The M-matrix M, its black pixels to be eliminated, and the Schur complement S of the others. All planes are
    padded."""

    tau: Float32Array
    """(H, W) row sums of M."""
    couplings: BFloat16Array
    """(4, H, W) couplings of M (`refine.solvers.amg.m_matrix.assemble_m_matrix`) in bfloat16; everything below is made
    of the rounded ones."""
    inverse_diagonal: Float32Array
    """(H, W) 1 / M_pp at eliminated pixels. At the others -`DAMPING` / S_pp, once S is known, and 0 before."""

    def restrict(self, residual: Float32Array, out: Float32Array) -> None:
        """The right-hand side for S of a residual of M; `out` is meaningless at eliminated pixels."""
        _restrict(self.couplings, self.inverse_diagonal, residual, out)

    def prolong(self, solution: Float32Array, residual: Float32Array, x: Float32Array) -> None:
        """Add to `x` the solution of M for a residual, given that of S at the remaining pixels."""
        _prolong(self.couplings, self.inverse_diagonal, solution, residual, x)

    def schur_complement(self) -> tuple[CSRMatrix, Float32Array, IndexArray]:
        """S as couplings and row sums, and the place of each remaining pixel in the flat, padded image."""
        number = np.full(self.tau.shape, -1, np.int32)
        inside = number[2:-2, 2:-2]
        remaining = self.inverse_diagonal[2:-2, 2:-2] <= 0
        size = np.count_nonzero(remaining)
        inside[remaining] = np.arange(size, dtype=np.int32)
        planes = np.zeros((6, *number.shape), np.float32)
        _schur_couplings(self.couplings, self.inverse_diagonal, planes)
        indptr = np.zeros(size + 1, np.int32)
        _count_entries(planes, number, indptr)
        np.cumsum(indptr, out=indptr)
        indices, data = np.empty(indptr[-1], np.int32), np.empty(indptr[-1], np.float32)
        _fill_csr(planes, number, indptr, indices, data)
        row_sum = np.empty(size, np.float32)
        _schur_row_sums(self.tau, self.couplings, self.inverse_diagonal, number, row_sum)
        return CSRMatrix(indptr, indices, data), row_sum, np.flatnonzero(number >= 0).astype(np.int32)


@dataclass(frozen=True)
class StencilSmoother:
    """`refine.solvers.amg.hierarchy.Smoother` for the Schur complement, without indices.

    Vectors are padded images, flat. With eliminated pixels set to the solution for a residual of 0 there, S is applied
    as M.
    """

    reduction: RedBlackReduction

    @property
    def size(self) -> int:
        """Pixels of the padded image."""
        return self.reduction.tau.size

    def pre_smooth(self, b: Float32Array, x: Float32Array, residual: Float32Array) -> None:
        """x = omega D^-1 b and residual = b - S x."""
        of, shape = self.reduction, self.reduction.tau.shape
        vectors = (vector.reshape(shape) for vector in (b, x, residual))
        _pre_smooth(of.tau, of.couplings, of.inverse_diagonal, *vectors)

    def post_smooth(self, b: Float32Array, x: Float32Array, out: Float32Array) -> None:
        """out = x + omega D^-1 (b - S x)."""
        of, shape = self.reduction, self.reduction.tau.shape
        vectors = (vector.reshape(shape) for vector in (b, x, out))
        _post_smooth(of.tau, of.couplings, of.inverse_diagonal, *vectors)


def red_black_reduction(tau: Float32Array, weights: BandWeights, color_scale: float) -> RedBlackReduction:
    """Set up the reduction of a refinement's M-matrix; arguments as for `assemble_m_matrix`."""
    couplings = round_to_bfloat16(assemble_m_matrix(tau, weights, color_scale))
    inverse_diagonal = np.zeros_like(tau)
    _select_eliminated(tau, couplings, inverse_diagonal)
    return RedBlackReduction(tau, couplings, inverse_diagonal)


def reduced_hierarchy(reduction: RedBlackReduction) -> Hierarchy:
    """The multigrid hierarchy of the Schur complement; vectors are padded images, flat. Completes
    `reduction.inverse_diagonal`."""

    def smoother(couplings: CSRMatrix, row_sum: Float32Array, place: IndexArray) -> StencilSmoother:
        inverse = reduction.inverse_diagonal.ravel()
        _invert_schur_diagonal(couplings.indptr, couplings.data, row_sum, place, inverse)
        return StencilSmoother(reduction)

    return build_hierarchy(reduction.schur_complement, smoother)


@njit(parallel=True)
def _select_eliminated(tau, w, inverse):
    """1 / M_pp at the black pixels that are coupled to no black one: those to be eliminated."""
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for row in prange(height):
        y = np.int64(row) + 2
        for x in range(3 - y % 2, width + 2, 2):
            diagonal = tau[y, x] + to_float32(w[0, y, x]) + to_float32(w[0, y, x - 1])
            diagonal += to_float32(w[1, y, x]) + to_float32(w[1, y - 1, x])
            black = w[2, y, x] | w[2, y - 1, x - 1] | w[3, y, x - 1] | w[3, y - 1, x]
            if black == 0 and diagonal > _SMALLEST_DIAGONAL:
                inverse[y, x] = 1 / diagonal


@njit(parallel=True)
def _schur_couplings(w, inverse, planes):
    """Couplings of the Schur complement, one square with (y, x) at its upper left at a time."""
    none = np.float32(0)
    for row in prange(inverse.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, inverse.shape[1] - 2):
            top, bottom = to_float32(w[0, y, x]), to_float32(w[0, y + 1, x])
            left, right = to_float32(w[1, y, x]), to_float32(w[1, y, x + 1])
            here, beside = max(inverse[y, x], none), max(inverse[y, x + 1], none)
            below, beyond = max(inverse[y + 1, x], none), max(inverse[y + 1, x + 1], none)
            planes[0, y, x] = top if max(here, beside) == 0 else none
            planes[3, y, x] = left if max(here, below) == 0 else none
            planes[1, y, x] = top * beside * to_float32(w[0, y, x + 1])
            planes[5, y, x] = left * below * to_float32(w[1, y + 1, x])
            planes[4, y, x], planes[2, y, x + 1] = to_float32(w[2, y, x]), to_float32(w[3, y, x])
            if (y + x) % 2 == 0:  # Black are the upper right and the lower left.
                planes[4, y, x] += top * beside * right + left * below * bottom
            else:
                planes[2, y, x + 1] += top * here * left + right * beyond * bottom


@njit()
def _coupling(planes, y, x, k):
    """Coupling of pixel (y, x) in the direction of offset k of `_REDUCED_STENCIL`."""
    return (
        planes[k - 6, y, x]
        if k >= 6
        else planes[5 - k, y + _REDUCED_STENCIL[k, 0], x + _REDUCED_STENCIL[k, 1]]
    )


@njit(parallel=True)
def _count_entries(planes, number, indptr):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, number.shape[1] - 2):
            if number[y, x] >= 0:
                count = 0
                for k in range(12):
                    count += _coupling(planes, y, x, k) > 0
                indptr[number[y, x] + 1] = count


@njit(parallel=True)
def _fill_csr(planes, number, indptr, indices, data):
    for row in prange(number.shape[0] - 4):
        y = np.int64(row) + 2
        for x in range(2, number.shape[1] - 2):
            if number[y, x] >= 0:
                at = indptr[number[y, x]]
                for k in range(12):
                    strength = _coupling(planes, y, x, k)
                    if strength > 0:
                        indices[at] = number[y + _REDUCED_STENCIL[k, 0], x + _REDUCED_STENCIL[k, 1]]
                        data[at] = strength
                        at += 1


@njit(parallel=True)
def _invert_schur_diagonal(indptr, data, row_sum, place, inverse):
    """-DAMPING / S_pp at the remaining pixels."""
    for i in prange(place.size):
        diagonal = np.float64(row_sum[i])
        for e in range(indptr[i], indptr[i + 1]):
            diagonal += data[e]
        inverse[place[i]] = -DAMPING / np.float32(diagonal) if diagonal > 0 else 0


# Below, a pixel is (y + 2, j + 2): for all that LLVM knows, an index like `j - 1` may be negative, and such loops are
# not vectorised.


@njit(fastmath={"contract"})
def _gather_eliminated(w, inverse, values, y, j):
    """What the eliminated neighbours of a pixel pass on to it: sum_q w_pq values_q / M_qq."""
    none = np.float32(0)
    across = to_float32(w[0, y + 2, j + 2]) * max(inverse[y + 2, j + 3], none) * values[y + 2, j + 3]
    across += to_float32(w[0, y + 2, j + 1]) * max(inverse[y + 2, j + 1], none) * values[y + 2, j + 1]
    down = to_float32(w[1, y + 2, j + 2]) * max(inverse[y + 3, j + 2], none) * values[y + 3, j + 2]
    down += to_float32(w[1, y + 1, j + 2]) * max(inverse[y + 1, j + 2], none) * values[y + 1, j + 2]
    return across + down


@njit(parallel=True)
def _schur_row_sums(tau, w, inverse, number, row_sum):
    for y in prange(number.shape[0] - 4):
        for x in range(number.shape[1] - 4):
            if number[y + 2, x + 2] >= 0:
                row_sum[number[y + 2, x + 2]] = tau[y + 2, x + 2] + _gather_eliminated(w, inverse, tau, y, x)


@njit(parallel=True, fastmath={"contract"})
def _restrict(w, inverse, residual, out):
    height, width = residual.shape[0] - 4, residual.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            out[y + 2, j + 2] = residual[y + 2, j + 2] + _gather_eliminated(w, inverse, residual, y, j)


@njit(fastmath={"contract"})
def _axial_sum(w, x, y, j):
    """sum_q w_pq x_q over the four axial neighbours."""
    total = (
        to_float32(w[0, y + 2, j + 2]) * x[y + 2, j + 3] + to_float32(w[0, y + 2, j + 1]) * x[y + 2, j + 1]
    )
    total += to_float32(w[1, y + 2, j + 2]) * x[y + 3, j + 2]
    return total + to_float32(w[1, y + 1, j + 2]) * x[y + 1, j + 2]


@njit(parallel=True, fastmath={"contract"})
def _prolong(w, inverse, solution, residual, x):
    height, width = residual.shape[0] - 4, residual.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            own = inverse[y + 2, j + 2]
            eliminated = own * (residual[y + 2, j + 2] + _axial_sum(w, solution, y, j))
            x[y + 2, j + 2] += eliminated if own > 0 else solution[y + 2, j + 2]


@njit(parallel=True, fastmath={"contract"})
def _fill_eliminated(w, inverse, x):
    """Set eliminated pixels to the solution for a residual of 0. Their axial neighbours all remain, so none reads what
    is written here."""
    height, width = inverse.shape[0] - 4, inverse.shape[1] - 4
    for y in prange(height):
        row = np.empty(width, np.float32)
        for j in range(width):
            own = inverse[y + 2, j + 2]
            row[j] = own * _axial_sum(w, x, y, j) if own > 0 else x[y + 2, j + 2]
        x[y + 2, 2:-2] = row


@njit(fastmath={"contract"})
def _residual(tau, w, b, x, y, j):
    """(b - M x)_p, from differences."""
    c = x[y + 2, j + 2]
    total = b[y + 2, j + 2] - tau[y + 2, j + 2] * c
    total += to_float32(w[0, y + 2, j + 2]) * (x[y + 2, j + 3] - c)
    total += to_float32(w[0, y + 2, j + 1]) * (x[y + 2, j + 1] - c)
    total += to_float32(w[1, y + 2, j + 2]) * (x[y + 3, j + 2] - c)
    total += to_float32(w[1, y + 1, j + 2]) * (x[y + 1, j + 2] - c)
    total += to_float32(w[2, y + 2, j + 2]) * (x[y + 3, j + 3] - c)
    total += to_float32(w[2, y + 1, j + 1]) * (x[y + 1, j + 1] - c)
    total += to_float32(w[3, y + 2, j + 1]) * (x[y + 3, j + 1] - c)
    return total + to_float32(w[3, y + 1, j + 2]) * (x[y + 1, j + 3] - c)


@njit(parallel=True, fastmath={"contract"})
def _pre_smooth(tau, w, inverse, b, x, residual):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            x[y + 2, j + 2] = min(inverse[y + 2, j + 2], np.float32(0)) * -b[y + 2, j + 2]
    _fill_eliminated(w, inverse, x)
    for y in prange(height):
        for j in range(width):
            residual[y + 2, j + 2] = _residual(tau, w, b, x, y, j)


@njit(parallel=True, fastmath={"contract"})
def _post_smooth(tau, w, inverse, b, x, out):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    _fill_eliminated(w, inverse, x)
    for y in prange(height):
        for j in range(width):
            damped = min(inverse[y + 2, j + 2], np.float32(0))
            out[y + 2, j + 2] = x[y + 2, j + 2] - damped * _residual(tau, w, b, x, y, j)

"""SELL-C-sigma: a level's couplings as the cycle's smoother reads them.

Rows have from none to thirty couplings, and no processor can predict where a loop over one row ends. So the unknowns
of a slice, `SLICE_HEIGHT` of them, are sorted by their number of couplings, those with most first. Their first
couplings are stored side by side, then their second ones, and so on (jagged diagonals): long loops that vectorise,
three times as fast as CSR. C and sigma are both the slice's height, so there is nothing to pad.

M. Kreutzer, G. Hager, G. Wellein, H. Fehske, A. R. Bishop, "A unified sparse matrix data format for efficient general
sparse matrix-vector multiplication on modern processors with wide SIMD units", SIAM J. Sci. Comput. 36 (5), 2014;
jagged diagonals: Y. Saad, "Krylov subspace methods on supercomputers", SIAM J. Sci. Stat. Comput. 10 (6), 1989.

Couplings are rounded to bfloat16, and the diagonal is that of the rounded ones. So the smoother's matrix is an M-matrix
with the level's own row sums, and within 0.4 % of the level's M-matrix in every quadratic form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refine.solvers.amg.csr import CSRMatrix
from refine.solvers.arrays import Float32Array, IndexArray
from refine.solvers.bfloat16 import BFloat16Array, to_bfloat16, to_float32
from stereoforge_kit.kernels import njit, prange

SLICE_HEIGHT = 512
"""C and sigma: unknowns that are stored together, and sorted among themselves."""
DAMPING = np.float32(0.7)
"""omega of the Jacobi smoother, which takes as many iterations as Gauss-Seidel and needs no order (docs/solver.md)."""
_COLUMN_BIAS = 1 << 15
"""How far before its slice a coupling's column may lie to be stored in 16 bits."""


@dataclass(frozen=True)
class SELLSmoother:
    """`refine.solvers.amg.hierarchy.Smoother` on couplings in SELL-C-sigma; vectors are in the sorted order."""

    slice_ptr: IndexArray
    """(slices + 1) first jagged diagonal of each slice."""
    diagonal_ptr: IndexArray
    """(jagged diagonals + 1) first coupling of each jagged diagonal."""
    column: NDArray[np.unsignedinteger[Any]]
    """(couplings) column minus the slice's first unknown, plus `column_bias`; 16 bits where these suffice, else 32."""
    values: BFloat16Array
    """(couplings)."""
    column_bias: int
    damped_inverse: Float32Array
    """(n) omega / diagonal, 0 where the diagonal is 0."""

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.damped_inverse.size

    def pre_smooth(self, b: Float32Array, x: Float32Array, residual: Float32Array) -> None:
        """x = omega D^-1 b and residual = b - M x."""
        _pre_smooth(
            self.slice_ptr,
            self.diagonal_ptr,
            self.column,
            self.values,
            self.column_bias,
            self.damped_inverse,
            b,
            x,
            residual,
        )

    def post_smooth(self, b: Float32Array, x: Float32Array, out: Float32Array) -> None:
        """out = x + omega D^-1 (b - M x)."""
        _post_smooth(
            self.slice_ptr,
            self.diagonal_ptr,
            self.column,
            self.values,
            self.column_bias,
            self.damped_inverse,
            b,
            x,
            out,
        )


def sell_smoother(couplings: CSRMatrix, row_sum: Float32Array) -> tuple[SELLSmoother, IndexArray]:
    """Convert an M-matrix from CSR.

    Args:
        couplings: Of the M-matrix.
        row_sum: (n) of the M-matrix.

    Returns:
        The smoother, and (n) the place of each unknown in its vectors.
    """
    size = row_sum.size
    slices = -(-size // SLICE_HEIGHT)
    position, longest = np.empty(size, np.int32), np.empty(slices, np.int32)
    bandwidth = _sort_by_length(couplings.indptr, couplings.indices, position, longest)
    slice_ptr = np.zeros(slices + 1, np.int32)
    np.cumsum(longest, out=slice_ptr[1:])
    narrow = bandwidth + SLICE_HEIGHT <= _COLUMN_BIAS
    diagonal_ptr = np.empty(slice_ptr[-1] + 1, np.int32)
    column: NDArray[np.unsignedinteger[Any]] = np.empty(
        couplings.indices.size, np.uint16 if narrow else np.uint32
    )
    values, damped_inverse = np.empty(couplings.data.size, np.uint16), np.empty(size, np.float32)
    bias = _COLUMN_BIAS if narrow else size
    _fill_slices(
        *couplings.arrays(), row_sum, position, slice_ptr, diagonal_ptr, column, values, bias, damped_inverse
    )
    return SELLSmoother(slice_ptr, diagonal_ptr, column, values, bias, damped_inverse), position


@njit(parallel=True)
def _sort_by_length(indptr, indices, position, longest):
    """Place the unknowns of each slice by their number of couplings, by counting sort; the bandwidth of the matrix."""
    bandwidth = 0
    for s in prange(longest.size):
        low, high = s * SLICE_HEIGHT, min(position.size, s * SLICE_HEIGHT + SLICE_HEIGHT)
        most = furthest = 0
        for i in range(low, high):
            most = max(most, indptr[i + 1] - indptr[i])
            for e in range(indptr[i], indptr[i + 1]):
                furthest = max(furthest, abs(indices[e] - i))
        bandwidth = max(bandwidth, furthest)
        longest[s] = most
        free = np.zeros(most + 2, np.int64)
        for i in range(low, high):
            free[most - indptr[i + 1] + indptr[i] + 1] += 1
        for length in range(most):
            free[length + 1] += free[length]
        for i in range(low, high):
            length = most - indptr[i + 1] + indptr[i]
            position[i] = low + free[length]
            free[length] += 1
    return bandwidth


@njit(parallel=True)
def _fill_slices(
    indptr, indices, data, row_sum, position, slice_ptr, diagonal_ptr, column, values, bias, damped_inverse
):
    for s in prange(slice_ptr.size - 1):
        low, high = s * SLICE_HEIGHT, min(position.size, s * SLICE_HEIGHT + SLICE_HEIGHT)
        diagonals = diagonal_ptr[slice_ptr[s] : slice_ptr[s + 1]]
        diagonals[:] = 0
        for i in range(low, high):
            for k in range(indptr[i + 1] - indptr[i]):
                diagonals[k] += 1
        at = indptr[low]
        for k in range(diagonals.size):
            at, diagonals[k] = at + diagonals[k], at
        for i in range(low, high):
            diagonal = np.float64(row_sum[i])
            for k in range(indptr[i + 1] - indptr[i]):
                e = indptr[i] + k
                at = diagonals[k] + position[i] - low
                column[at] = position[indices[e]] + bias - low
                values[at] = to_bfloat16(data[e])
                diagonal += to_float32(values[at])
            damped_inverse[position[i]] = DAMPING / np.float32(diagonal) if diagonal > 0 else 0
    diagonal_ptr[diagonal_ptr.size - 1] = column.size


@njit(fastmath={"contract"})
def _add_couplings(slice_ptr, diagonal_ptr, column, values, offset, s, x, out):
    """out_i += sum_j w_ij x_j for the unknowns of slice s."""
    for k in range(slice_ptr[s], slice_ptr[s + 1]):
        first, last = diagonal_ptr[k], diagonal_ptr[k + 1]
        columns, couplings = column[first:last], values[first:last]
        for i in range(columns.size):
            out[i] += to_float32(couplings[i]) * x[np.uint64(columns[i] + offset)]


@njit(parallel=True, fastmath={"contract"})
def _pre_smooth(slice_ptr, diagonal_ptr, column, values, bias, damped_inverse, b, x, residual):
    """With x = omega D^-1 b, b - M x = (1 - omega) b + W x."""
    for i in prange(b.size):
        x[i] = damped_inverse[i] * b[i]
    for s in prange(slice_ptr.size - 1):
        low, high = s * SLICE_HEIGHT, min(b.size, s * SLICE_HEIGHT + SLICE_HEIGHT)
        for i in range(low, high):
            residual[i] = (1 - DAMPING) * b[i]
        _add_couplings(slice_ptr, diagonal_ptr, column, values, low - bias, s, x, residual[low:high])


@njit(parallel=True, fastmath={"contract"})
def _post_smooth(slice_ptr, diagonal_ptr, column, values, bias, damped_inverse, b, x, out):
    """x + omega D^-1 (b - M x) = (1 - omega) x + omega D^-1 (b + W x)."""
    for s in prange(slice_ptr.size - 1):
        low, high = s * SLICE_HEIGHT, min(b.size, s * SLICE_HEIGHT + SLICE_HEIGHT)
        for i in range(low, high):
            out[i] = b[i]
        _add_couplings(slice_ptr, diagonal_ptr, column, values, low - bias, s, x, out[low:high])
        for i in range(low, high):
            out[i] = (1 - DAMPING) * x[i] + damped_inverse[i] * out[i]

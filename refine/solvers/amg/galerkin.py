"""The coarse level's matrix: the Galerkin product P' M P, in CSR."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refine.solvers.amg.csr import CSRMatrix
from refine.solvers.arrays import Float32Array, IndexArray
from stereoforge_kit.kernels import njit, prange


@dataclass(frozen=True)
class RowBlocks:
    """A matrix in CSR in blocks of rows, so that the level above need not be alive when they are concatenated."""

    indptr: IndexArray
    indices: list[IndexArray]
    data: list[Float32Array]

    def concatenated(self) -> CSRMatrix:
        """The whole matrix; the blocks are emptied."""
        indices = np.concatenate(self.indices)
        self.indices.clear()
        data = np.concatenate(self.data)
        self.data.clear()
        return CSRMatrix(self.indptr, indices, data)


def galerkin_product(
    couplings: CSRMatrix,
    diagonal: Float32Array,
    row_sum: Float32Array,
    interpolation: CSRMatrix,
    coarse_size: int,
    bounds: NDArray[np.int64],
) -> tuple[RowBlocks, Float32Array]:
    """Compute P' M P for an M-matrix M.

    Args:
        couplings: Of M.
        diagonal: (n) of M.
        row_sum: (n) of M.
        interpolation: P.
        coarse_size: Number of P's columns.
        bounds: Where the blocks of rows begin and end that are computed in parallel.

    Returns:
        The couplings of the product, and (coarse_size) its row sums.
    """
    restriction = _transposed(interpolation, coarse_size)
    indptr, coarse_row_sum = np.zeros(coarse_size + 1, np.int32), np.empty(coarse_size, np.float32)
    parent, share = np.empty(diagonal.size, np.uint32), np.empty(diagonal.size, np.float32)
    p_row_sum = np.empty(diagonal.size, np.float32)
    longest = _first_entries(*interpolation.arrays(), np.uint32(coarse_size), parent, share, p_row_sum)
    blocks = _multiply(
        *_unsigned(couplings), diagonal, row_sum, p_row_sum, parent, share, *_unsigned(interpolation), longest,
        *_unsigned(restriction), bounds, indptr, coarse_row_sum,
    )  # fmt: skip
    np.cumsum(indptr, out=indptr)
    indices, data = zip(*blocks, strict=True)
    return RowBlocks(indptr, list(indices), list(data)), coarse_row_sum


def _transposed(matrix: CSRMatrix, columns: int) -> CSRMatrix:
    indptr = np.zeros(columns + 1, np.int32)
    indices, data = np.empty_like(matrix.indices), np.empty_like(matrix.data)
    _transpose(*matrix.arrays(), indptr, indices, data)
    return CSRMatrix(indptr, indices, data)


@njit()
def _transpose(indptr, indices, data, new_indptr, new_indices, new_data):
    for j in indices:
        new_indptr[j + 1] += 1
    for j in range(new_indptr.size - 1):
        new_indptr[j + 1] += new_indptr[j]
    free = new_indptr[:-1].copy()
    for i in range(indptr.size - 1):
        for e in range(indptr[i], indptr[i + 1]):
            at = free[indices[e]]
            free[indices[e]] += 1
            new_indices[at] = i
            new_data[at] = data[e]


def _unsigned(matrix: CSRMatrix) -> tuple[NDArray[np.uint32], NDArray[np.uint32], Float32Array]:
    """For a kernel: it need not test an index that cannot be negative for counting from the end."""
    return matrix.indptr.view(np.uint32), matrix.indices.view(np.uint32), matrix.data


@njit(parallel=True)
def _first_entries(indptr, indices, data, none, parent, share, p_row_sum):
    """The first entry of each row of P, (none, 0) where there is none, and the row's sum; the length of the longest
    row."""
    longest = 1
    for i in prange(p_row_sum.size):
        parent[i], share[i] = none, 0
        if indptr[i] < indptr[i + 1]:
            parent[i], share[i] = indices[indptr[i]], data[indptr[i]]
        total = np.float32(0)
        for e in range(indptr[i], indptr[i + 1]):
            total += data[e]
        p_row_sum[i] = total
        longest = max(longest, indptr[i + 1] - indptr[i])
    return longest


@njit()
def _accumulate(j, amount, row, marker, sums, columns, used):
    """sums[j] += amount; j is appended to the columns if the row has not met it, without a branch."""
    new = marker[j] != row
    marker[j] = row
    columns[used] = j
    sums[j] = (0.0 if new else sums[j]) + amount
    return used + new


@njit()
def _multiply_rows(
    indptr, indices, data, diagonal, row_sum, p_row_sum, parent, share, p_indptr, p_indices, p_data, longest,
    r_indptr, r_indices, r_data, first, last, count, coarse_row_sum,
):  # fmt: skip
    """Rows `first` up to `last` of P' M P without the diagonal, as couplings.

    Row by row with a dense accumulator (F. G. Gustavson, "Two fast algorithms for sparse matrices: multiplication and
    permuted transposition", ACM Trans. Math. Softw. 4 (3), 1978).
    Most rows of P have one entry: the first is taken without testing whether it is there.
    """
    one = np.uint32(1)
    columns = np.empty(12 * (last - first) + 64, np.int32)
    values = np.empty(columns.size, np.float32)
    marker, sums = np.full(r_indptr.size, -1, np.int32), np.empty(r_indptr.size, np.float64)
    used = 0
    for row in range(first, last):
        before, needed = used, used
        for e in range(r_indptr[row], r_indptr[row + 1]):
            needed += (indptr[r_indices[e] + one] - indptr[r_indices[e]] + 1) * longest
        if needed > columns.size:
            columns = np.concatenate((columns, np.empty(needed, np.int32)))
            values = np.concatenate((values, np.empty(needed, np.float32)))
        # The diagonal, and what has no parent, count as met: they are not appended.
        marker[row] = marker[r_indptr.size - 1] = row
        total = 0.0
        for e in range(r_indptr[row], r_indptr[row + 1]):
            i = r_indices[e]
            product = np.float64(row_sum[i] * p_row_sum[i])  # (M P 1)_i, from differences
            for f in range(np.int64(indptr[i]) - 1, np.int64(indptr[i + one])):
                own = f < indptr[i]
                k = i if own else indices[np.uint32(f)]
                coupling = -diagonal[i] if own else data[np.uint32(f)]
                product += coupling * (p_row_sum[i] - p_row_sum[k])
                coupling *= r_data[e]
                used = _accumulate(parent[k], coupling * share[k], row, marker, sums, columns, used)
                for g in range(p_indptr[k] + one, p_indptr[k + one]):
                    used = _accumulate(p_indices[g], coupling * p_data[g], row, marker, sums, columns, used)
            total += r_data[e] * product
        coarse_row_sum[row] = total
        for at in range(before, used):
            values[at] = sums[columns[at]]
        count[row + 1] = used - before
    return columns[:used].copy(), values[:used].copy()


@njit(parallel=True)
def _multiply(
    indptr, indices, data, diagonal, row_sum, p_row_sum, parent, share, p_indptr, p_indices, p_data, longest,
    r_indptr, r_indices, r_data, bounds, count, coarse_row_sum,
):  # fmt: skip
    empty = (np.empty(0, np.int32), np.empty(0, np.float32))
    blocks = [empty for _ in range(bounds.size - 1)]
    for block in prange(bounds.size - 1):
        blocks[block] = _multiply_rows(
            indptr, indices, data, diagonal, row_sum, p_row_sum, parent, share, p_indptr, p_indices, p_data,
            longest, r_indptr, r_indices, r_data, bounds[block], bounds[block + 1], count, coarse_row_sum,
        )  # fmt: skip
    return blocks

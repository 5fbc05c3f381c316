"""Compressed sparse rows (CSR) as plain arrays for numba."""

from __future__ import annotations

from dataclasses import dataclass

from refine.solvers.arrays import Float32Array, IndexArray


@dataclass(frozen=True)
class CSRMatrix:
    """A sparse matrix in CSR format, named as in scipy: row i has the entries indptr[i] to indptr[i + 1]."""

    indptr: IndexArray
    """(rows + 1)."""
    indices: IndexArray
    """(entries) column of each entry, in any order within a row."""
    data: Float32Array
    """(entries)."""

    def arrays(self) -> tuple[IndexArray, IndexArray, Float32Array]:
        """(indptr, indices, data), the arguments of a kernel."""
        return self.indptr, self.indices, self.data

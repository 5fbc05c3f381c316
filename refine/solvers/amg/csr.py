"""Sparse matrices by rows, as plain arrays for numba."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from refine.solvers.stencil.operator import Singles

Indices = NDArray[np.int32]


@dataclass(frozen=True)
class Rows:
    """A sparse matrix by rows."""

    start: Indices
    column: Indices
    value: Singles


def of(rows: Rows) -> tuple[Indices, Indices, Singles]:
    """The arrays, for a kernel."""
    return rows.start, rows.column, rows.value

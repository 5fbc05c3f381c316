"""The multigrid hierarchy: Ruge and Stueben's classical coarsening of an M-matrix, and its V-cycle.

The couplings of neighbouring pixels jump by five orders of magnitude from one pixel to the next, along every edge and
every grain of texture. Coarse grids laid regularly over the image cannot follow that; five such designs were tried (see
docs/solver.md). So coarse unknowns are chosen by strength of connection, and interpolation follows the strong couplings
only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from refine.solvers.amg.cf_splitting import cf_splitting, sort_by_strength
from refine.solvers.amg.csr import CSRMatrix
from refine.solvers.amg.galerkin import RowBlocks, galerkin_product
from refine.solvers.amg.interpolation import Interpolation, arrange_interpolation, direct_interpolation
from refine.solvers.amg.sell import sell_smoother
from refine.solvers.arrays import Float32Array, IndexArray
from stereoforge_kit.kernels import njit, prange

STRENGTH_THRESHOLD = 0.5
"""theta: i depends strongly on j if their coupling is at least this share of i's largest. At 0.25 the coarse levels
hold twice the couplings, and the number of iterations is the same."""
DOMINANCE = 0.2
"""A row whose couplings sum to this share of its diagonal or less is left to the smoother."""
MAX_COARSE = 256
"""Up to this many unknowns a level is solved densely."""
_MAX_LEVELS = 30
_STALLED = 0.9
"""Coarsening ends where a level keeps more than this share of the one above."""
_CHUNKS = 8
"""Parts of a level that are split independently; a constant, so that results do not depend on the number of
threads."""
_CHUNK_FROM = 4096
"""Smaller levels are one chunk."""


class Smoother(Protocol):
    """Damped Jacobi on a level's M-matrix M. Vectors are flat, (size)."""

    @property
    def size(self) -> int:
        """Length of the level's vectors."""

    def pre_smooth(self, b: Float32Array, x: Float32Array, residual: Float32Array) -> None:
        """One step from 0 for M x = b into `x`, and b - M x into `residual`."""

    def post_smooth(self, b: Float32Array, x: Float32Array, out: Float32Array) -> None:
        """One step from `x` into `out`."""


FirstLevel = Callable[[], tuple[CSRMatrix, Float32Array, IndexArray]]
"""() -> couplings, row sums, and the place of each unknown in the level's vectors."""
SmootherFactory = Callable[[CSRMatrix, Float32Array, IndexArray], Smoother]
"""(couplings, row sums, places) -> smoother."""


@dataclass(frozen=True)
class Level:
    """A level of the hierarchy, but for the coarsest; the vectors are the cycle's work space."""

    smoother: Smoother
    interpolation: Interpolation
    x: Float32Array
    residual: Float32Array
    """After post-smoothing the level's solution."""
    coarse_b: Float32Array
    """The next level's right-hand side."""


@dataclass(frozen=True)
class Hierarchy:
    """All levels from fine to coarse; at least one and the coarsest."""

    levels: tuple[Level, ...]
    coarsest_inverse: Float32Array
    """(n, n) inverse of the coarsest matrix; (n) that of its diagonal where coarsening stalled."""

    def v_cycle(self, b: Float32Array) -> Float32Array:
        """An approximate solution of M x = b by one symmetric V(1, 1)-cycle; the next call overwrites it."""
        right_hand_sides = [b]
        for level in self.levels:
            level.smoother.pre_smooth(right_hand_sides[-1], level.x, level.residual)
            level.interpolation.restrict(level.residual, level.coarse_b)
            right_hand_sides.append(level.coarse_b)
        solution = self._solve_coarsest(right_hand_sides.pop())
        for level, level_b in zip(reversed(self.levels), reversed(right_hand_sides), strict=True):
            level.interpolation.prolong(solution, level.x)
            level.smoother.post_smooth(level_b, level.x, level.residual)
            solution = level.residual
        return solution

    def _solve_coarsest(self, b: Float32Array) -> Float32Array:
        inverse = self.coarsest_inverse
        return inverse * b if inverse.ndim == 1 else _product(inverse, b)


def build_hierarchy(first: FirstLevel, smoother_factory: SmootherFactory) -> Hierarchy:
    """Set up the hierarchy for an M-matrix.

    Args:
        first: Makes the M-matrix. A function, so that only the hierarchy holds the couplings, and only as long as it
            needs them.
        smoother_factory: Makes the smoother of the first level.
    """
    levels: list[Level] = []
    couplings, row_sum, position = first()
    smoother = smoother_factory(couplings, row_sum, position)
    while True:
        interpolation, blocks, coarse_row_sum = _coarsen(couplings, row_sum)
        del couplings  # before the blocks are concatenated: the most memory is held here
        couplings = blocks.concatenated()
        fine_size, coarse_size = row_sum.size, coarse_row_sum.size
        row_sum = coarse_row_sum
        stalled = coarse_size / fine_size > _STALLED
        coarsest = coarse_size <= MAX_COARSE or stalled or len(levels) + 1 == _MAX_LEVELS
        coarse_position = np.arange(coarse_size, dtype=np.int32)
        coarse_smoother: Smoother | None = None
        if not coarsest:
            coarse_smoother, coarse_position = sell_smoother(couplings, row_sum)
        arranged = arrange_interpolation(interpolation, position, coarse_position)
        del interpolation
        vectors = (np.zeros(size, np.float32) for size in (smoother.size, smoother.size, coarse_size))
        levels.append(Level(smoother, arranged, *vectors))
        if coarse_smoother is None:
            return Hierarchy(tuple(levels), _coarsest_inverse(couplings, row_sum))
        smoother, position = coarse_smoother, coarse_position


def _coarsen(couplings: CSRMatrix, row_sum: Float32Array) -> tuple[CSRMatrix, RowBlocks, Float32Array]:
    """P, and the couplings and row sums of P' M P; sorts the couplings of M."""
    diagonal = _diagonal(couplings.indptr, couplings.data, row_sum)
    strong_ends, state = sort_by_strength(*couplings.arrays(), diagonal, STRENGTH_THRESHOLD, DOMINANCE)
    cf_splitting(couplings.indptr, couplings.indices, strong_ends, state, _chunk_bounds(state.size))
    interpolation, coarse_size = direct_interpolation(couplings, diagonal, row_sum, strong_ends, state)
    del strong_ends, state
    bounds = _chunk_bounds(coarse_size)
    blocks, coarse_row_sum = galerkin_product(
        couplings, diagonal, row_sum, interpolation, coarse_size, bounds
    )
    return interpolation, blocks, coarse_row_sum


def _chunk_bounds(size: int) -> NDArray[np.int64]:
    """Where the chunks of a level begin and end."""
    return np.linspace(0, size, (_CHUNKS if size >= _CHUNK_FROM else 1) + 1).astype(np.int64)


def _coarsest_inverse(couplings: CSRMatrix, row_sum: Float32Array) -> Float32Array:
    """The dense inverse, or that of the diagonal alone where the level is too large for it."""
    if row_sum.size <= 4 * MAX_COARSE:
        return _dense_inverse(couplings, row_sum)
    diagonal = _diagonal(couplings.indptr, couplings.data, row_sum)
    return np.divide(1, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)


def _dense_inverse(couplings: CSRMatrix, row_sum: Float32Array) -> Float32Array:
    """The pseudo-inverse, symmetric in spite of rounding."""
    size = row_sum.size
    if size == 0:
        return np.zeros((0, 0), np.float32)
    matrix = np.zeros((size, size))
    row = np.repeat(np.arange(size), np.diff(couplings.indptr))
    np.add.at(matrix, (row, couplings.indices), -couplings.data.astype(np.float64))
    matrix[np.diag_indices(size)] += row_sum - matrix.sum(axis=1)
    return np.linalg.pinv((matrix + matrix.T) / 2, hermitian=True).astype(np.float32)


@njit(parallel=True)
def _diagonal(indptr, data, row_sum):
    diagonal = np.empty(row_sum.size, np.float32)
    for i in prange(row_sum.size):
        total = np.float64(row_sum[i])
        for e in range(indptr[i], indptr[i + 1]):
            total += data[e]
        diagonal[i] = total
    return diagonal


@njit()
def _product(matrix, b):
    """A small dense product: BLAS would wake threads of its own, which then compete with ours."""
    out = np.zeros(matrix.shape[0], matrix.dtype)
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[i] += matrix[i, j] * b[j]
    return out

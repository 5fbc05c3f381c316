"""Sparse direct solvers: the reference, exact to rounding, minutes for half a million pixels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.sparse.linalg import splu

from refine.energy.affinity import Floats
from refine.energy.system import MRFSystem
from refine.solvers.linear import LinearSolution, Problem, SolverError

BAND_ENTRIES = 1 << 26
"""Largest banded matrix that is stored, in entries of 8 bytes: half a GiB, an image of 320x320 or 500x250 pixels."""

Inverse = Callable[[Floats], Floats]
"""b -> A^-1 b, both (H W)."""


def solve_direct(problem: Problem, tolerance: float) -> LinearSolution:  # noqa: ARG001
    """Solve by a factorisation.

    The exact form's matrix is symmetric positive definite and, with pixels numbered along the shorter side, banded:
    while it is small, LAPACK's banded Cholesky takes a third of SuperLU's time. Anything else goes to SuperLU.

    Args:
        problem: The refinement; its `start` does not matter.
        tolerance: Does not matter; here because all solvers have it.

    Raises:
        SolverError: If the matrix is singular, that is if nothing determines the disparity of some region.
    """
    system = problem.system()
    height, width = problem.shape
    inverse = _banded_cholesky(system) or _sparse_lu(system)
    x = inverse(system.right_hand_side)
    # One step of iterative refinement recovers the digits lost to large jumps between coefficients.
    x += inverse(system.right_hand_side - system.apply(x))
    if not np.isfinite(x).all():
        raise SolverError(
            f"the MRF of {width}x{height} pixels has no finite solution; "
            "some region has neither a disparity nor a tie to its surroundings"
        )
    return LinearSolution(x.reshape(height, width), 0, system.relative_residual(x), converged=True)


def _banded_cholesky(system: MRFSystem) -> Inverse | None:
    """Factorise as a banded matrix; None for the paper's form, if the band is too large, and if the matrix is
    indefinite to rounding."""
    height, width = system.shape
    bandwidth = 2 * min(height, width) + 2  # to the corner of the 25-point stencil
    count = height * width
    if system.form != "exact" or (bandwidth + 1) * count > BAND_ENTRIES:
        return None
    pixels = np.arange(count).reshape(height, width)
    order = (pixels if width <= height else pixels.T).ravel()
    position = np.argsort(order)
    matrix = sp.coo_array(system.matrix())
    rows, columns = position[matrix.row], position[matrix.col]
    lower = rows >= columns
    band = np.zeros((bandwidth + 1, count), order="F")
    band[(rows - columns)[lower], columns[lower]] = matrix.data[lower]
    try:
        factor = cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False)
    except LinAlgError:
        return None

    def inverse(b: Floats) -> Floats:
        x: Floats = cho_solve_banded((factor, True), b[order], check_finite=False)[position]
        return x

    return inverse


def _sparse_lu(system: MRFSystem) -> Inverse:
    """Factorise by SuperLU. Both forms have a heavy diagonal and a symmetric pattern: minimum degree ordering of
    A' + A and pivots on the diagonal fill in far less than the defaults for general matrices."""
    try:
        factors = splu(
            sp.csc_matrix(system.matrix()),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0 if system.form == "exact" else 0.1,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        height, width = system.shape
        raise SolverError(f"the MRF of {width}x{height} pixels is singular: {error}") from error
    return factors.solve

"""Factorising the matrix: the reference, exact to rounding, minutes for half a million pixels."""

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
"""Largest band that is stored, in numbers of 8 bytes: half a GiB, a square of 320 pixels or 500 x 250."""

Inverse = Callable[[Floats], Floats]


def solve_direct(problem: Problem, tolerance: float) -> LinearSolution:  # noqa: ARG001
    """Solve by a factorisation; neither `problem.start` nor `tolerance` matters to it.

    The exact form's matrix is symmetric, positive definite and, pixels counted along the shorter side, a band: LAPACK's
    Cholesky takes a third of SuperLU's time on it while it is small. Anything else is SuperLU's.

    Raises:
        SolverError: If the matrix is singular, that is if nothing determines the disparity of some region.
    """
    system = problem.system()
    height, width = problem.shape
    inverse = _banded(system) or _sparse(system)
    x = inverse(system.right_hand_side)
    # One step of iterative refinement wins back the digits that large jumps between coefficients cost.
    x += inverse(system.right_hand_side - system.apply(x))
    if not np.isfinite(x).all():
        raise SolverError(
            f"the MRF of {width}x{height} pixels has no finite solution; "
            "some region has neither a disparity nor a tie to its surroundings"
        )
    return LinearSolution(x.reshape(height, width), 0, system.relative_residual(x), converged=True)


def _banded(system: MRFSystem) -> Inverse | None:
    """Cholesky of the band; None where there is none, where it is too large, and where it is indefinite to rounding."""
    height, width = system.shape
    reach = 2 * min(height, width) + 2  # two pixels, diagonally, at either end of the 25-point stencil
    count = height * width
    if system.form != "exact" or (reach + 1) * count > BAND_ENTRIES:
        return None
    pixels = np.arange(count).reshape(height, width)
    order = (pixels if width <= height else pixels.T).ravel()
    place = np.argsort(order)
    matrix = sp.coo_array(system.matrix())
    rows, columns = place[matrix.row], place[matrix.col]
    lower = rows >= columns
    band = np.zeros((reach + 1, count), order="F")
    band[(rows - columns)[lower], columns[lower]] = matrix.data[lower]
    try:
        factor = cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False)
    except LinAlgError:
        return None

    def inverse(b: Floats) -> Floats:
        x: Floats = cho_solve_banded((factor, True), b[order], check_finite=False)[place]
        return x

    return inverse


def _sparse(system: MRFSystem) -> Inverse:
    """SuperLU of the matrix. Both forms are diagonally led and symmetric in structure: the ordering for A' + A and
    pivots from the diagonal fill in far less than the defaults for general matrices."""
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

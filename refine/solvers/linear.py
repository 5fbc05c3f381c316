"""What every solver returns, and the Krylov iteration that the iterative ones share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, bicgstab, cg

from refine.system import MRFSystem
from refine.weights import Floats


class SolverError(RuntimeError):
    """The linear system could not be solved."""


@dataclass(frozen=True)
class LinearSolution:
    """An approximate solution of A x = b in float64, and how it was reached."""

    x: Floats
    iterations: int
    """Of the Krylov method; 0 for a direct solver."""
    converged: bool


def krylov(
    system: MRFSystem,
    start: Floats,
    tolerance: float,
    precondition: Callable[[Floats], Floats],
    max_iterations: int,
) -> LinearSolution:
    """Conjugate gradients for the symmetric exact form, BiCGSTAB for the paper's, until |b - A x| <=
    tolerance |b|.

    A BiCGSTAB iteration costs about two of CG.
    """
    size = start.size
    iterations = 0

    def count(_: Floats) -> None:
        nonlocal iterations
        iterations += 1

    method = cg if system.form == "exact" else bicgstab
    x, _ = method(
        LinearOperator((size, size), matvec=system.apply, dtype=np.float64),
        system.right_hand_side,
        x0=start,
        rtol=tolerance,
        atol=0.0,
        maxiter=max_iterations,
        M=LinearOperator((size, size), matvec=precondition, dtype=np.float64),
        callback=count,
    )
    # The recurrence's own residual drifts from the true one, so convergence is judged by the true one.
    converged = bool(np.isfinite(x).all()) and system.relative_residual(x) <= 2 * tolerance
    return LinearSolution(x=x, iterations=iterations, converged=converged)

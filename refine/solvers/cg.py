"""Krylov iterations with a Jacobi preconditioner: no set-up, little memory, hundreds of iterations."""

from __future__ import annotations

import numpy as np

from refine.solvers.krylov import krylov
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencils import couplings_of, operator_of, pad

MAX_ITERATIONS = 5000


def solve_cg(problem: Problem, tolerance: float) -> LinearSolution:
    """Solve by Jacobi-preconditioned CG (the exact form) or BiCGSTAB (the paper's)."""
    parts = couplings_of(problem)
    operator = operator_of(parts, problem.form)
    inverse = operator.inverse_diagonal()
    start = pad(problem.start, np.float64)
    return krylov(
        operator, parts.right_hand_side, start, tolerance, lambda residual: inverse * residual, MAX_ITERATIONS
    )

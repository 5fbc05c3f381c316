"""Krylov iterations with a Jacobi preconditioner: no set-up, little memory, hundreds of iterations."""

from __future__ import annotations

import numpy as np

from refine.solvers.krylov import solve_iteratively
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencil.operator import Singles, data_weight, system_of

MAX_ITERATIONS = 5000


def solve_cg(problem: Problem, tolerance: float) -> LinearSolution:
    """Solve by Jacobi-preconditioned CG (the exact form) or BiCGSTAB (the paper's)."""
    system = system_of(problem, data_weight(problem))
    inverse = system.operator.inverse_diagonal()

    def precondition(residual: Singles, out: Singles) -> None:
        np.multiply(inverse, residual, out=out)

    return solve_iteratively(problem, system, tolerance, precondition, MAX_ITERATIONS)

"""Krylov iterations with a Jacobi preconditioner: no set-up, little memory, hundreds of iterations."""

from __future__ import annotations

import numpy as np

from refine.solvers.arrays import Float32Array
from refine.solvers.krylov import solve_iteratively
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencil.right_hand_side import assemble_system
from refine.solvers.stencil.weights import data_weight

MAX_ITERATIONS = 5000


def solve_cg(problem: Problem, tolerance: float) -> LinearSolution:
    """Solve by CG (the exact form) or BiCGSTAB (the paper's), preconditioned by the inverse diagonal of A.

    Args:
        problem: The refinement.
        tolerance: Relative residual |b - A x| / |b| at which the iterations stop.

    Raises:
        refine.SolverError: If nothing determines some pixel.
    """
    system = assemble_system(problem, data_weight(problem))
    inverse = system.operator.inverse_diagonal()

    def precondition(residual: Float32Array, out: Float32Array) -> None:
        np.multiply(inverse, residual, out=out)

    return solve_iteratively(problem, system, tolerance, precondition, MAX_ITERATIONS)

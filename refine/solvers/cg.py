"""Conjugate gradients with a Jacobi preconditioner: no set-up, little memory, hundreds of iterations."""

from __future__ import annotations

from refine.solvers.linear import LinearSolution, krylov
from refine.system import MRFSystem
from refine.weights import Floats

MAX_ITERATIONS = 5000


def solve_cg(system: MRFSystem, start: Floats, tolerance: float) -> LinearSolution:
    """Solve by Jacobi-preconditioned CG (the exact form) or BiCGSTAB (the paper's)."""
    inverse_diagonal = 1 / system.diagonal()
    return krylov(system, start, tolerance, lambda residual: inverse_diagonal * residual, MAX_ITERATIONS)

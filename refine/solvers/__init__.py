"""Solvers of the MRF's linear system A x = b, one a module: "direct", "cg" and "multigrid".

Each is a function (problem, tolerance) -> LinearSolution, imported where it is used: the iterative ones bring numba
along. `stencil` holds A and b without sparse matrices, `amg` the algebraic multigrid, `krylov` the iterations.
"""

from __future__ import annotations

from refine.solvers.linear import LinearSolution, Problem, SolverError

__all__ = ["LinearSolution", "Problem", "SolverError", "solve"]


def solve(problem: Problem, solver: str, tolerance: float) -> LinearSolution:
    """Solve a refinement's linear system.

    Args:
        problem: The refinement.
        solver: "multigrid", "cg" or "direct".
        tolerance: Relative residual |b - A x| / |b| at which the iterative solvers stop.

    Raises:
        SolverError: If the matrix is singular.
    """
    if solver == "multigrid":
        from refine.solvers.multigrid import solve_multigrid

        return solve_multigrid(problem, tolerance)
    if solver == "cg":
        from refine.solvers.cg import solve_cg

        return solve_cg(problem, tolerance)
    from refine.solvers.direct import solve_direct

    return solve_direct(problem, tolerance)

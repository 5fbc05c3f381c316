"""Solvers of the MRF's linear system: one a module, each a function (problem, tolerance) -> LinearSolution.

Imported where they are used: the iterative ones bring numba along.
"""

from __future__ import annotations

from refine.solvers.linear import LinearSolution, Problem, SolverError

__all__ = ["LinearSolution", "Problem", "SolverError", "solve"]


def solve(problem: Problem, solver: str, tolerance: float) -> LinearSolution:
    """Run the solver of that name: "multigrid", "cg" or "direct"."""
    if solver == "multigrid":
        from refine.solvers.multigrid import solve_multigrid

        return solve_multigrid(problem, tolerance)
    if solver == "cg":
        from refine.solvers.cg import solve_cg

        return solve_cg(problem, tolerance)
    from refine.solvers.direct import solve_direct

    return solve_direct(problem, tolerance)

"""Solvers of the MRF's linear system: one a module, each a function (system, start, tolerance) ->
LinearSolution."""

from refine.solvers.cg import solve_cg
from refine.solvers.direct import solve_direct
from refine.solvers.linear import LinearSolution, SolverError
from refine.solvers.multigrid import solve_multigrid

__all__ = ["LinearSolution", "SolverError", "solve_cg", "solve_direct", "solve_multigrid"]

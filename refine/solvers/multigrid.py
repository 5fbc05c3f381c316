"""Krylov iterations preconditioned by one multigrid cycle, smoothing with A itself on the image and with an
M-matrix below.

The exact form's A = N + beta L' Phibar L is no M-matrix: its colour term is a squared Laplacian, on which
algebraic coarsening fails. A graph Laplacian c (Phibar W + W' Phibar) in its place makes an M-matrix that
coarsens well, but it overrates smooth disparities: with it factorised exactly, CG still needs 20 to 30
iterations. The cycle here splits the work. On the image it smooths with A, which settles everything
oscillating; the coarse levels, which see only what is smooth, take the M-matrix with a small c. That halves
the iterations (figures in docs/solver.md).
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from refine.solvers.chessboard import Coarsening, coarsen
from refine.solvers.halves import halves, widened
from refine.solvers.krylov import solve_iteratively
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencils import Singles, StencilOperator, data_weight, system_of

MAX_ITERATIONS = 1000
"""Without the gradient term and with a large beta, hundreds are needed, and still faster than a direct solve."""
COLOR_SCALE = 0.5
"""c: from 0.25 to 0.5 the number of iterations changes by one; at 1 it is half as many again."""
DAMPING = 0.6
"""Of the Jacobi smoother on the image; A's largest eigenvalue is below 3 times its diagonal."""


def solve_multigrid(problem: Problem, tolerance: float) -> LinearSolution:
    """Solve by CG (the exact form) or BiCGSTAB (the paper's), one V-cycle an application of the
    preconditioner."""
    tau = data_weight(problem)
    # The hierarchy first: while it is built, A and what belongs to it need not be there.
    below = coarsen(problem, tau, COLOR_SCALE)
    system = system_of(problem, tau)
    return solve_iteratively(problem, system, tolerance, Cycle(system.operator, below), MAX_ITERATIONS)


class Cycle:
    """The preconditioner: Jacobi with A, coarse correction, Jacobi with A; symmetric where A is."""

    def __init__(self, operator: StencilOperator, below: Coarsening) -> None:
        self._operator = operator
        self._below = below
        self._step = halves(np.float32(DAMPING) * operator.inverse_diagonal())
        self._x, self._left = np.zeros_like(operator.tau), np.zeros_like(operator.tau)

    def __call__(self, residual: Singles, out: Singles) -> None:
        """An approximate solution of A x = residual, padded, into `out`."""
        x, left = self._x, self._left
        _first(self._step, residual, x)
        self._operator.remainder(residual, x, out)
        self._below.elimination.restrict(out, left)
        correction = self._below.hierarchy.correct(left.ravel())
        self._below.elimination.prolong(correction.reshape(x.shape), out, x)
        self._operator.smooth(residual, self._step, x, out)


@njit(cache=True, parallel=True)
def _first(step, residual, x):
    for y in prange(x.shape[0]):
        for j in range(x.shape[1]):
            x[y, j] = widened(step[y, j]) * residual[y, j]

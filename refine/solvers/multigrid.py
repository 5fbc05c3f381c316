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

from functools import partial

import numpy as np
from numba import njit, prange

from refine.energy.affinity import Floats
from refine.solvers.amg.red_black import Coarsening, coarsen
from refine.solvers.bfloat16 import halves, widened
from refine.solvers.krylov import Iterated, krylov, solve_iteratively
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencil.operator import (
    Couplings,
    Singles,
    StencilOperator,
    couplings_of,
    data_weight,
    operator_of,
    system_of,
)

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
    below = coarsen(tau, partial(couplings_of, problem, tau), COLOR_SCALE)
    system = system_of(problem, tau)
    return solve_iteratively(problem, system, tolerance, Cycle(system.operator, below), MAX_ITERATIONS)


class GivenSystem:
    """The exact form's A for couplings that may come from anywhere, for any number of right-hand sides.

    Args:
        couplings: Of the whole image, finite, 0 towards what is outside. A may have negative ones, which the
            preconditioner takes for none.

    Raises:
        refine.SolverError: If nothing determines some pixel.
    """

    def __init__(self, couplings: Couplings) -> None:
        tau = couplings.tau
        # As for `solve_multigrid`: the hierarchy first, and nothing of the whole image is made for it.
        below = coarsen(tau, lambda first, last: couplings.rows(first, last).positive(), COLOR_SCALE)
        self._operator = operator_of(tau, couplings.rows, "exact")
        self._cycle = Cycle(self._operator, below)

    def solve(self, b: Floats, tolerance: float) -> Iterated:
        """Down to a residual of tolerance |b|; `Iterated.residual` tells whether it was reached. `b` is padded, and
        overwritten. The coefficients are float32, which moves the solution by rounding too."""
        size = float(np.linalg.norm(b))
        return krylov(self._operator, b, tolerance * size, self._cycle, MAX_ITERATIONS)


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

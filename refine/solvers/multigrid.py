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

from refine.solvers.chessboard import Elimination, eliminate_black, grid_hierarchy
from refine.solvers.hierarchy import Hierarchy
from refine.solvers.krylov import krylov
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.rows import Rows
from refine.solvers.stencils import Singles, StencilOperator, couplings_of, operator_of, pad

MAX_ITERATIONS = 1000
"""Without the gradient term and with a large beta, hundreds are needed, and still faster than a direct solve."""
COLOR_SCALE = 0.5
"""c: from 0.25 to 0.5 the number of iterations changes by one; at 1 it is half as many again."""
DAMPING = 0.6
"""Of the Jacobi smoother on the image; A's largest eigenvalue is below 3 times its diagonal."""


def solve_multigrid(problem: Problem, tolerance: float) -> LinearSolution:
    """Solve by CG (the exact form) or BiCGSTAB (the paper's), one V-cycle an application of the
    preconditioner."""
    parts = couplings_of(problem)
    operator = operator_of(parts, problem.form)
    right_hand_side = parts.right_hand_side
    reduced = eliminate_black(parts, COLOR_SCALE)
    del parts  # the pixels' weights are in the operator and the reduced graph now
    cycle = cycle_of(operator, *reduced)
    del reduced
    start = pad(problem.start, np.float64)
    return krylov(operator, right_hand_side, start, tolerance, cycle, MAX_ITERATIONS)


def cycle_of(operator: StencilOperator, elimination: Elimination, graph: Rows, excess: Singles) -> Cycle:
    """The preconditioner for one form's operator, of what `eliminate_black` makes with `COLOR_SCALE`."""
    return Cycle(operator, elimination, grid_hierarchy(elimination, graph, excess))


class Cycle:
    """The preconditioner: Jacobi with A, coarse correction, Jacobi with A; symmetric where A is."""

    def __init__(self, operator: StencilOperator, elimination: Elimination, hierarchy: Hierarchy) -> None:
        self._operator = operator
        self._elimination = elimination
        self._hierarchy = hierarchy
        self._step = DAMPING * operator.inverse_diagonal()
        self._x, self._product = np.zeros_like(operator.tau), np.zeros_like(operator.tau)
        self._left = np.zeros_like(operator.tau)

    def __call__(self, residual: Singles) -> Singles:
        """An approximate solution of A x = residual, padded; overwritten by the next call."""
        x, product = self._x, self._product
        _first(self._step, residual, x)
        self._operator.apply(x, product)
        _remainder(residual, product)
        self._elimination.restrict(product, self._left)
        correction = self._hierarchy.correct(self._left.ravel())
        self._elimination.prolong(correction.reshape(x.shape), product, x)
        self._operator.apply(x, product)
        _smooth(self._step, residual, product, x)
        return x


@njit(cache=True, parallel=True)
def _first(step, residual, x):
    for y in prange(x.shape[0]):
        for j in range(x.shape[1]):
            x[y, j] = step[y, j] * residual[y, j]


@njit(cache=True, parallel=True)
def _remainder(residual, product):
    """residual - product, into product."""
    for y in prange(product.shape[0]):
        for j in range(product.shape[1]):
            product[y, j] = residual[y, j] - product[y, j]


@njit(cache=True, parallel=True)
def _smooth(step, residual, product, x):
    for y in prange(x.shape[0]):
        for j in range(x.shape[1]):
            x[y, j] += step[y, j] * (residual[y, j] - product[y, j])

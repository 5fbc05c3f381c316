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

from refine.solvers.hierarchy import Hierarchy, build_hierarchy
from refine.solvers.krylov import krylov
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencils import Singles, StencilOperator, couplings_of, operator_of, pad

MAX_ITERATIONS = 200
COLOR_SCALE = 0.5
"""c: from 0.25 to 0.5 the number of iterations changes by one; at 1 it is half as many again."""
DAMPING = 0.6
"""Of the Jacobi smoother on the image; A's largest eigenvalue is below 3 times its diagonal."""


def solve_multigrid(problem: Problem, tolerance: float) -> LinearSolution:
    """Solve by CG (the exact form) or BiCGSTAB (the paper's), one V-cycle an application of the
    preconditioner."""
    parts = couplings_of(problem)
    hierarchy = build_hierarchy(parts, COLOR_SCALE)
    operator = operator_of(parts, problem.form)
    right_hand_side = parts.right_hand_side
    del parts  # the pixels' weights are in the operator now
    cycle = Cycle(operator, hierarchy)
    start = pad(problem.start, np.float64)
    return krylov(operator, right_hand_side, start, tolerance, cycle, MAX_ITERATIONS)


class Cycle:
    """The preconditioner: Jacobi with A, coarse correction, Jacobi with A; symmetric where A is."""

    def __init__(self, operator: StencilOperator, hierarchy: Hierarchy) -> None:
        self._operator = operator
        self._hierarchy = hierarchy
        self._step = DAMPING * operator.inverse_diagonal()
        self._x, self._product = np.zeros_like(operator.tau), np.zeros_like(operator.tau)
        self._coarse = np.empty(hierarchy.restrict.start.size - 1, np.float32)

    def __call__(self, residual: Singles) -> Singles:
        """An approximate solution of A x = residual, padded; overwritten by the next call."""
        x, product = self._x, self._product
        np.multiply(self._step, residual, out=x)
        self._operator.apply(x, product)
        down, up = self._hierarchy.restrict, self._hierarchy.prolong
        _restrict(down.start, down.column, down.value, residual, product, self._coarse)
        _prolong(up.start, up.column, up.value, self._hierarchy.correct(self._coarse), x)
        self._operator.apply(x, product)
        _smooth(self._step, residual, product, x)
        return x


@njit(cache=True, parallel=True)
def _restrict(start, column, value, residual, product, out):
    """out = R (residual - product), the image padded."""
    width = residual.shape[1] - 4
    for i in prange(out.size):
        total = np.float32(0)
        for e in range(start[i], start[i + 1]):
            y, x = column[e] // width + 2, column[e] % width + 2
            total += value[e] * (residual[y, x] - product[y, x])
        out[i] = total


@njit(cache=True, parallel=True)
def _prolong(start, column, value, coarse, x):
    """x += P coarse, the image padded."""
    height, width = x.shape[0] - 4, x.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            total = np.float32(0)
            for e in range(start[y * width + j], start[y * width + j + 1]):
                total += value[e] * coarse[column[e]]
            x[y + 2, j + 2] += total


@njit(cache=True, parallel=True)
def _smooth(step, residual, product, x):
    for y in prange(x.shape[0]):
        for j in range(x.shape[1]):
            x[y, j] += step[y, j] * (residual[y, j] - product[y, j])

"""Krylov iterations preconditioned by one multigrid cycle: smoothing with A on the image, an M-matrix below.

The exact form's A = N + beta L' Phibar L is no M-matrix: its colour term is a squared Laplacian, on which algebraic
coarsening fails. A graph Laplacian with couplings c (Phibar W + W' Phibar) in its place makes an M-matrix that coarsens
well, but it overrates smooth disparities: preconditioned with its exact inverse, CG still needs 20 to 30 iterations. So
the cycle splits the work. On the image it smooths with A, which removes oscillating errors; the coarse levels, which
see smooth errors only, take the M-matrix with a small c. That halves the iterations (figures in docs/solver.md).
"""

from __future__ import annotations

from functools import partial

import numpy as np

from refine.energy.affinity import Floats
from refine.solvers.amg.hierarchy import Hierarchy
from refine.solvers.amg.red_black import RedBlackReduction, red_black_reduction, reduced_hierarchy
from refine.solvers.arrays import Float32Array
from refine.solvers.bfloat16 import round_to_bfloat16, to_float32
from refine.solvers.krylov import KrylovResult, krylov, solve_iteratively
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencil.operator import StencilOperator, assemble_operator
from refine.solvers.stencil.right_hand_side import assemble_system
from refine.solvers.stencil.weights import BandWeights, StencilWeights, data_weight, stencil_weights
from stereoforge_kit.kernels import njit, prange

MAX_ITERATIONS = 1000
"""Without the gradient term and with a large beta, hundreds are needed, and still faster than a direct solve."""
COLOR_SCALE = 0.5
"""c: from 0.25 to 0.5 the number of iterations changes by one; at 1 it is half as many again."""
DAMPING = 0.6
"""omega of the Jacobi smoother on the image; A's largest eigenvalue is below 3 times its diagonal."""


def solve_multigrid(problem: Problem, tolerance: float) -> LinearSolution:
    """Solve by CG (the exact form) or BiCGSTAB (the paper's), preconditioned by one V-cycle.

    Args:
        problem: The refinement.
        tolerance: Relative residual |b - A x| / |b| at which the iterations stop.

    Raises:
        refine.SolverError: If nothing determines some pixel.
    """
    tau = data_weight(problem)
    # The coarse levels first: while they are set up, A and what belongs to it need not be there.
    coarse = CoarseCorrection(tau, partial(stencil_weights, problem, tau))
    system = assemble_system(problem, tau)
    cycle = MultigridCycle(system.operator, coarse)
    return solve_iteratively(problem, system, tolerance, cycle, MAX_ITERATIONS)


class MultigridSolver:
    """Multigrid-preconditioned CG for weights from anywhere, set up once for any number of right-hand sides.

    Args:
        weights: Of the whole image, finite, 0 towards what is outside; A is their exact form. Negative weights go into
            A; the preconditioner takes them as 0.

    Raises:
        refine.SolverError: If nothing determines some pixel.
    """

    def __init__(self, weights: StencilWeights) -> None:
        # The coarse levels first, as in `solve_multigrid`, and a band at a time: no copy of the whole image's weights.
        coarse = CoarseCorrection(weights.tau, lambda first, last: weights.band(first, last).clamped())
        self._operator = assemble_operator(weights.tau, weights.band, "exact")
        self._cycle = MultigridCycle(self._operator, coarse)

    def solve(self, b: Floats, tolerance: float) -> KrylovResult:
        """Solve A x = b from 0 until |b - A x| <= tolerance |b|.

        The coefficients are float32, which moves the solution as well, by rounding.

        Args:
            b: (H, W), padded; overwritten.
            tolerance: Relative residual.

        Returns:
            The solution; its `residual_norm` tells whether the tolerance was reached.
        """
        norm = float(np.linalg.norm(b))
        return krylov(self._operator, b, tolerance * norm, self._cycle, MAX_ITERATIONS)


class CoarseCorrection:
    """The M-matrix in A's stead: red-black reduction, then the hierarchy of the remaining pixels.

    Args:
        tau: (H, W) weight of the data term, padded.
        weights: Of the energy, called once for each band of rows.
    """

    def __init__(self, tau: Float32Array, weights: BandWeights) -> None:
        self._reduction: RedBlackReduction = red_black_reduction(tau, weights, COLOR_SCALE)
        self._hierarchy: Hierarchy = reduced_hierarchy(self._reduction)
        self._reduced = np.zeros_like(tau)

    def add(self, residual: Float32Array, x: Float32Array) -> None:
        """Add to `x` an approximate solution of M e = residual; both (H, W), padded."""
        self._reduction.restrict(residual, self._reduced)
        correction = self._hierarchy.v_cycle(self._reduced.ravel())
        self._reduction.prolong(correction.reshape(x.shape), residual, x)


class MultigridCycle:
    """The preconditioner: pre-smoothing with A, coarse correction, post-smoothing with A; symmetric where A is."""

    def __init__(self, operator: StencilOperator, coarse: CoarseCorrection) -> None:
        self._operator = operator
        self._coarse = coarse
        self._damped_inverse = round_to_bfloat16(np.float32(DAMPING) * operator.inverse_diagonal())
        self._x = np.zeros_like(operator.tau)

    def __call__(self, residual: Float32Array, out: Float32Array) -> None:
        """Write an approximate solution of A x = residual into `out`; both (H, W), padded."""
        x = self._x
        _pre_smooth(self._damped_inverse, residual, x)
        self._operator.residual(residual, x, out)
        self._coarse.add(out, x)
        self._operator.jacobi_step(residual, self._damped_inverse, x, out)


@njit(parallel=True)
def _pre_smooth(damped_inverse, b, x):
    """x = omega D^-1 b: a step of damped Jacobi from 0."""
    for y in prange(x.shape[0]):
        for j in range(x.shape[1]):
            x[y, j] = to_float32(damped_inverse[y, j]) * b[y, j]

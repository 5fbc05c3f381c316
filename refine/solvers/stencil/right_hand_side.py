"""The right-hand side b, assembled together with A: the linear system of a refinement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from refine.energy.affinity import Floats
from refine.solvers.arrays import Float32Array
from refine.solvers.linear import Problem
from refine.solvers.stencil.operator import StencilOperator, assemble_operator
from refine.solvers.stencil.padding import pad
from refine.solvers.stencil.weights import StencilWeights, stencil_weights
from stereoforge_kit.kernels import njit, prange


@dataclass(frozen=True)
class StencilSystem:
    """A x = b, written for the correction to the initial guess x0."""

    operator: StencilOperator
    residual: Floats
    """(H, W) b - A x0, padded. In float64: across a step of the disparity it is thousands of times what the confidence
    floor holds a pixel by."""
    right_hand_side_norm: float
    """|b|."""


def assemble_system(problem: Problem, tau: Float32Array) -> StencilSystem:
    """Assemble the system of a refinement.

    A is N + beta L' Phibar L (exact form) or N + beta Phibar L (the paper's), and b = T D + alpha C' Phi G
    (`refine.energy.system`).

    Args:
        problem: The refinement.
        tau: Its `refine.solvers.stencil.weights.data_weight`.
    """
    b = np.zeros(tau.shape)

    def weights(first: int, last: int) -> StencilWeights:
        band = stencil_weights(problem, tau, first, last)
        # b is assembled here, because the band is not kept.
        _assemble_right_hand_side(problem.disparity, problem.gradient, band.tau, band.gradient, first, b)
        return band

    operator = assemble_operator(tau, weights, problem.form)
    norm = float(np.linalg.norm(b))
    operator.residual(b, pad(problem.start, np.float64), b)
    return StencilSystem(operator, b, norm)


@njit(parallel=True)
def _assemble_right_hand_side(disparity, gradient, tau, gradient_weight, first, right_hand_side):
    """Rows of b = T D + alpha C' Phi G from `first` on."""
    width = disparity.shape[1]
    for row in prange(tau.shape[0] - 4):
        y = np.int64(row) + first
        for x in range(width):
            value = tau[row + 2, x + 2] * np.float64(disparity[y, x])
            for channel in range(2):
                back_y, back_x = channel, 1 - channel
                weight = gradient_weight[channel, row + 2, x + 2]
                if weight > 0:
                    value -= weight * np.float64(gradient[y, x, channel])
                weight = gradient_weight[channel, row + 2 - back_y, x + 2 - back_x]
                if weight > 0:
                    value += weight * np.float64(gradient[y - back_y, x - back_x, channel])
            right_hand_side[y + 2, x + 2] = value

"""The posterior uncertainty of each refined disparity.

The energy E is quadratic, so exp(-E) is a Gaussian over disparity maps with the refined one as its mean and
(2 A)^-1 as its covariance. Samples of it cost one solve each (Papandreou and Yuille, "Gaussian sampling by
local perturbations", 2010): A = F' F with a row of F for each term of E, and A^-1 F' n has covariance A^-1 for
white noise n. The spread of N samples is off by 1 / sqrt(2 N) of itself, however far the disparities hang
together; probing the diagonal with random signs was tried and was off by half in smooth areas.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from refine.energy.affinity import NEIGHBORS, Floats
from refine.energy.parameters import MRFParameters
from refine.mrf.solve import checked_problem
from refine.solvers.linear import SolverError
from refine.solvers.multigrid import MultigridSolver
from refine.solvers.stencil.padding import crop
from refine.solvers.stencil.weights import StencilWeights, data_weight, stencil_weights
from stereoforge_kit.errors import InputError

TOLERANCE = 1e-3
"""Relative residual of each sample's solve: far below the sampling error."""


def posterior_deviation(
    disparity: ArrayLike,
    confidence: ArrayLike,
    gradient: ArrayLike,
    image: ArrayLike,
    parameters: MRFParameters = MRFParameters(),  # noqa: B008 - frozen
    samples: int = 32,
    seed: int = 0,
    gradient_factor: Floats | None = None,
) -> NDArray[np.float32]:
    """Standard deviation of each refined disparity under the MRF's own Gaussian, exact form.

    It is in pixels if the energy is taken as a log-likelihood. Use its order rather than its size: it tells which
    disparities are least certain.

    Args:
        disparity: As for `refine.refine_disparity`, like the next four.
        confidence: (H, W).
        gradient: (H, W, 2).
        image: (H, W, 3) uint8.
        parameters: The energy's weights.
        samples: Solves. The relative standard error of the result is 1 / sqrt(2 samples): 0.125 for 32.
        seed: Of the noise.
        gradient_factor: (H, W, 2), by which the weights of the gradient terms are multiplied: for an energy that is
            not quadratic, its curvature where it is least (`refine.mrf.robust.curvature_factor`).

    Returns:
        (H, W) float32.

    Raises:
        ValueError: If an input is wrong.
        refine.SolverError: If the system is singular or a solve does not converge.
    """
    if samples < 1:
        raise InputError(f"samples must be at least 1, got {samples}")
    problem = checked_problem(disparity, confidence, gradient, image, parameters, "exact")
    problem = replace(problem, gradient_factor=gradient_factor)
    weights = stencil_weights(problem, data_weight(problem))
    solver = MultigridSolver(weights)
    rng = np.random.default_rng(seed)
    total = np.zeros(problem.shape)
    for _ in range(samples):
        noise = _perturbation(weights, rng)
        size = float(np.linalg.norm(noise))
        solved = solver.solve(noise, TOLERANCE)
        if not solved.residual_norm <= TOLERANCE * size:
            raise SolverError(
                f"a sample of the posterior stopped at a relative residual of {solved.residual_norm / size:.1e}, "
                f"short of {TOLERANCE:.1e}"
            )
        total += crop(solved.x) ** 2
    return np.sqrt(total / samples / 2).astype(np.float32)


def _perturbation(weights: StencilWeights, rng: np.random.Generator) -> Floats:
    """F' n, padded: every term of the energy pushed by noise of its own weight."""
    shape = weights.tau.shape
    push: Floats = np.sqrt(weights.tau) * rng.standard_normal(shape)
    for axis, weight in ((1, weights.gradient[0]), (0, weights.gradient[1])):
        flow = np.sqrt(weight) * rng.standard_normal(shape)
        push += np.roll(flow, 1, axis) - flow
    flow = np.sqrt(weights.color) * rng.standard_normal(shape)
    push += flow
    for (dy, dx), weight in zip(NEIGHBORS, weights.neighbors, strict=True):
        push -= np.roll(weight * flow, (dy, dx), (0, 1))
    return push

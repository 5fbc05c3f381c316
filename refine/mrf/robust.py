"""The MRF with a robust gradient term, which tolerates a few large differences.

The paper's gradient term is quadratic: where the disparity steps and the image has no edge to say so, one step of 20 px
costs what 400 steps of 1 px do, so the solution smears it, and alpha cannot be large. Here the term is Charbonnier's,
quadratic up to `scale` and linear beyond (Charbonnier, Blanc-Feraud, Aubert, Barlaud, "Deterministic edge-preserving
regularization in computed imaging", 1997):

    alpha sum_p [phi_x,p psi(S_right - S_p - Gx_p) + phi_y,p psi(S_below - S_p - Gy_p)],
    psi(e) = 2 scale^2 (sqrt(1 + e^2 / scale^2) - 1),

the other terms being those of `refine.energy.system`. E stays convex, so it has one minimum, which reweighting finds: a
quadratic MRF again and again, its gradient terms times psi'(e) / (2 e) = 1 / sqrt(1 + e^2 / scale^2) of the solution
before. Each lowers E. The solutions creep towards the minimum, step after step the same way, so the terms are weighed
as far ahead of a solution as it has come from the one before (over-relaxation). No theorem says that each still lowers
E then, but four solves do what five did on real pairs (docs/solver.md).
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from refine.energy.affinity import Floats
from refine.energy.parameters import MRFParameters
from refine.mrf.solve import DEFAULT_TOLERANCE, MRFSolution, SolverName, checked_problem, solve_problem
from stereoforge_kit.errors import InputError

DEFAULT_REWEIGHTINGS = 3
AHEAD = 1.0
"""How far ahead of a solution the terms are weighed, in steps from the one before; 0 would be plain reweighting."""
WEIGHING_TOLERANCE = 1e-4
"""Of all solves but the last, whose solutions only weigh the terms of the next."""


def solve_robust(
    disparity: ArrayLike,
    confidence: ArrayLike,
    gradient: ArrayLike,
    image: ArrayLike,
    parameters: MRFParameters,
    scale: float,
    reweightings: int = DEFAULT_REWEIGHTINGS,
    solver: SolverName = "auto",
    tolerance: float = DEFAULT_TOLERANCE,
) -> MRFSolution:
    """Refine a disparity map by the MRF, in the exact form, with Charbonnier's gradient term.

    Args:
        disparity: As for `refine.refine_disparity`, like the next four.
        confidence: (H, W).
        gradient: (H, W, 2).
        image: (H, W, 3) uint8.
        parameters: The energy's weights.
        scale: In pixels a pixel: differences from the predicted gradient beyond it cost linearly.
        reweightings: Solves after the first one, each starting from the one before; 0 is the quadratic MRF.
        solver: As for `refine.refine_disparity`.
        tolerance: Relative residual at which the last solve stops; `WEIGHING_TOLERANCE` does for the others.

    Returns:
        The refined disparity; `info` is the last solve's, with the iterations and the time of all.

    Raises:
        ValueError: If an input is wrong.
        refine.SolverError: If a system is singular.
    """
    check_scale(scale)
    if reweightings < 0:
        raise InputError(f"there cannot be {reweightings} reweightings")
    began = time.perf_counter()
    problem = checked_problem(disparity, confidence, gradient, image, parameters, "exact")
    tolerances = [max(tolerance, WEIGHING_TOLERANCE)] * reweightings + [tolerance]
    solution = solve_problem(problem, solver, tolerances[0])
    iterations = solution.info.iterations
    before = solution.disparity
    for next_tolerance in tolerances[1:]:
        here = solution.disparity
        factor = gradient_factor(here + AHEAD * (here - before), problem.gradient, scale)
        again = replace(problem, start=here, gradient_factor=factor)
        before, solution = here, solve_problem(again, solver, next_tolerance)
        iterations += solution.info.iterations
    info = replace(solution.info, iterations=iterations, seconds=time.perf_counter() - began)
    return MRFSolution(solution.disparity, info)


def check_scale(scale: float) -> None:
    """Raise InputError unless the value can be a scale of the gradient term: finite and positive."""
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"the gradient term's scale must be positive, got {scale}")


def gradient_factor(disparity: Floats, gradient: Floats, scale: float) -> Floats:
    """1 / sqrt(1 + e^2 / scale^2), e the differences' deviations from the gradient; (H, W, 2), 1 where it has none."""
    off = np.zeros_like(gradient)
    off[:, :-1, 0] = np.diff(disparity, axis=1) - gradient[:, :-1, 0]
    off[:-1, :, 1] = np.diff(disparity, axis=0) - gradient[:-1, :, 1]
    factor: Floats = 1 / np.sqrt(1 + np.square(np.nan_to_num(off, nan=0.0) / scale))
    return factor


def curvature_factor(disparity: ArrayLike, gradient: ArrayLike, scale: float) -> Floats:
    """psi''(e) / 2 = (1 + e^2 / scale^2)^(-3/2): how much the energy bends, as part of what the quadratic one does."""
    depths, slopes = np.asarray(disparity, np.float64), np.asarray(gradient, np.float64)
    curvature: Floats = gradient_factor(depths, slopes, scale) ** 3
    return curvature

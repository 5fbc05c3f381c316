"""Refining a disparity map by the continuous MRF (Cheng, He, Zhang, Pattern Recognition 74, 2018, Sec.
3.3)."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt

from refine.energy.affinity import Floats
from refine.energy.parameters import MRFParameters
from refine.energy.system import Form
from refine.solvers import LinearSolution, Problem, solve
from stereoforge_kit.errors import InputError

SolverName = Literal["auto", "multigrid", "cg", "direct"]

DEFAULT_TOLERANCE = 1e-7
"""Relative residual at which the iterative solvers stop. At 960x540 it left no pixel of the exact form further
than 0.004 from the direct solution (1e-6: 0.05), of the paper's form 0.05; mean errors are final at 1e-3."""

_SOLVERS = ("multigrid", "cg", "direct")
_DIRECT_UP_TO_PIXELS = 4096
"""Up to this size "auto" takes the direct solver: tens of milliseconds either way, and exact."""


class ConvergenceWarning(UserWarning):
    """An iterative solver stopped short of its tolerance, and the direct solver was used instead."""


@dataclass(frozen=True)
class SolveInfo:
    """How a refinement was computed."""

    solver: str
    """The solver that gave the result: "multigrid", "cg" or "direct"."""
    iterations: int
    relative_residual: float
    seconds: float
    """Wall-clock time, weights and set-up included."""
    fell_back: bool
    """Whether the solver asked for did not converge, and the direct one took over."""


@dataclass(frozen=True)
class MRFSolution:
    """A refined disparity map in full precision."""

    disparity: Floats
    """(H, W) float64, pixels."""
    info: SolveInfo


def refine_disparity(
    disparity: ArrayLike,
    confidence: ArrayLike,
    gradient: ArrayLike,
    image: ArrayLike,
    parameters: MRFParameters = MRFParameters(),  # noqa: B008 - frozen
    form: Form = "exact",
    solver: SolverName = "auto",
    tolerance: float = DEFAULT_TOLERANCE,
    x0: ArrayLike | None = None,
) -> NDArray[np.float32]:
    """Refine a disparity map: keep confident disparities, follow the predicted gradients elsewhere.

    Args:
        disparity: (H, W) initial disparity in pixels. NaN, where there is none, counts as the nearest known
            disparity with confidence 0.
        confidence: (H, W) in [0, 1].
        gradient: (H, W, 2) forward differences [dx, dy] of the disparity to be expected, pixels a pixel. NaN
            leaves that difference free; the last column of dx and the last row of dy are not used.
        image: (H, W, 3) uint8, the view the disparity belongs to.
        parameters: The energy's weights.
        form: "exact" minimises the energy; "paper" solves the paper's Eq. 8 as printed (see `refine.energy.system`).
        solver: "direct", "cg", "multigrid", or "auto": direct for small images, multigrid for others.
        tolerance: Relative residual |b - A x| / |b| at which "cg" and "multigrid" stop.
        x0: (H, W) where these two start, such as the result of the frame before; the initial disparity if
            None.

    Returns:
        (H, W) float32 refined disparity, finite everywhere.

    Raises:
        InputError: If a shape, type or range is wrong, or no pixel has a disparity. It is a ValueError.
        refine.SolverError: If the system is singular: with a `confidence_floor` of 0, a region without confidence that
            nothing ties to its surroundings.

    Examples:
        A box in front of a wall. Beside it the wall's disparity is wrong, which its confidence says; the image's edge
        keeps the box and the wall apart.

        >>> import numpy as np
        >>> from refine import refine_disparity
        >>> disparity = np.array([[9.0, 9.0, 9.0, 2.0, 2.0]] * 3)
        >>> confidence = np.array([[1.0, 1.0, 0.01, 1.0, 1.0]] * 3)
        >>> gradient = np.zeros((3, 5, 2))
        >>> image = np.zeros((3, 5, 3), np.uint8)
        >>> image[:, 2:] = 200
        >>> refine_disparity(disparity, confidence, gradient, image).round(1)[0].tolist()
        [9.0, 9.0, 2.0, 2.0, 2.0]
    """
    return solve_mrf(
        disparity, confidence, gradient, image, parameters, form, solver, tolerance, x0
    ).disparity.astype(np.float32)


def solve_mrf(
    disparity: ArrayLike,
    confidence: ArrayLike,
    gradient: ArrayLike,
    image: ArrayLike,
    parameters: MRFParameters = MRFParameters(),  # noqa: B008 - frozen
    form: Form = "exact",
    solver: SolverName = "auto",
    tolerance: float = DEFAULT_TOLERANCE,
    x0: ArrayLike | None = None,
) -> MRFSolution:
    """Refine as `refine_disparity` does; return the disparity in float64 and how it was computed.

    Arguments and errors are those of `refine_disparity`.

    Returns:
        The refined disparity, (H, W) float64, and `SolveInfo`: solver, iterations, residual, seconds.

    Examples:
        One confident pixel in an image of one colour, and a predicted slope of half a pixel a pixel:

        >>> import numpy as np
        >>> from refine import solve_mrf
        >>> disparity = np.full((1, 5), 10.0)
        >>> confidence = np.array([[1.0, 0.0, 0.0, 0.0, 0.0]])
        >>> gradient = np.zeros((1, 5, 2))
        >>> gradient[..., 0] = 0.5
        >>> image = np.full((1, 5, 3), 128, np.uint8)
        >>> solution = solve_mrf(disparity, confidence, gradient, image)
        >>> solution.disparity.round(1)[0].tolist()
        [10.0, 10.5, 11.0, 11.5, 12.0]
        >>> solution.info.solver, solution.info.fell_back
        ('direct', False)
    """
    began = time.perf_counter()
    if form not in ("exact", "paper"):
        raise InputError(f"the MRF's form is 'exact' or 'paper', not {form!r}")
    problem = checked_problem(disparity, confidence, gradient, image, parameters, form, x0)
    solution = solve_problem(problem, solver, tolerance)
    return replace(solution, info=replace(solution.info, seconds=time.perf_counter() - began))


def solve_problem(problem: Problem, solver: SolverName, tolerance: float) -> MRFSolution:
    """Solve by the named solver, or by the direct one where that does not converge."""
    began = time.perf_counter()
    if solver not in ("auto", *_SOLVERS):
        raise InputError(f"the MRF's solver is one of 'auto', 'multigrid', 'cg', 'direct', not {solver!r}")
    if not 0 < tolerance < 1:
        raise InputError(f"the solver's tolerance must be between 0 and 1, got {tolerance}")
    name = solver
    if solver == "auto":
        name = "direct" if problem.disparity.size <= _DIRECT_UP_TO_PIXELS else "multigrid"
    solution, used = _solve(problem, name, tolerance)
    info = SolveInfo(
        solver=used,
        iterations=solution.iterations,
        relative_residual=solution.relative_residual,
        seconds=time.perf_counter() - began,
        fell_back=used != name,
    )
    return MRFSolution(solution.x, info)


def checked_problem(
    disparity: ArrayLike,
    confidence: ArrayLike,
    gradient: ArrayLike,
    image: ArrayLike,
    parameters: MRFParameters,
    form: Form,
    x0: ArrayLike | None = None,
) -> Problem:
    """The inputs of `refine_disparity` as arrays, missing disparities filled; ValueError if one is wrong."""
    known, trust, slopes, colors = _checked(disparity, confidence, gradient, image)
    unknown = np.isnan(known)
    initial = _filled(known, unknown)
    return Problem(
        disparity=initial,
        confidence=np.where(unknown, 0, trust) if unknown.any() else trust,
        gradient=slopes,
        image=colors,
        parameters=parameters,
        form=form,
        start=initial if x0 is None else _checked_start(x0, initial.shape),
    )


def _solve(problem: Problem, name: str, tolerance: float) -> tuple[LinearSolution, str]:
    """Solve by the named solver, or by the direct one where that does not converge; also the solver used."""
    solution = solve(problem, name, tolerance)
    if solution.converged:
        return solution, name
    warnings.warn(
        f"the {name} solver stopped at a relative residual of {solution.relative_residual:.1e}, "
        f"short of {tolerance:.1e}, after {solution.iterations} iterations; solving directly instead",
        ConvergenceWarning,
        stacklevel=5,
    )
    return solve(problem, "direct", tolerance), "direct"


def _checked_start(x0: ArrayLike, shape: tuple[int, ...]) -> Floats:
    start = np.asarray(x0, dtype=np.float64)
    if start.shape != shape:
        raise InputError(f"x0 has shape {start.shape}, the disparity {shape}")
    if not np.isfinite(start).all():
        raise InputError("x0 holds values that are not finite")
    return start


def _checked(
    disparity: ArrayLike, confidence: ArrayLike, gradient: ArrayLike, image: ArrayLike
) -> tuple[Floats, Floats, Floats, NDArray[np.uint8]]:
    """The inputs as contiguous float64 (image: uint8) arrays, or a ValueError that says which is wrong and how."""
    depths = np.ascontiguousarray(disparity, dtype=np.float64)
    if depths.ndim != 2 or depths.size == 0:
        raise InputError(f"disparity must be (H, W) with at least one pixel, got shape {depths.shape}")
    if np.isinf(depths).any():
        raise InputError("disparity holds infinities; mark missing values by NaN")
    if np.isnan(depths).all():
        raise InputError(
            f"none of the {depths.shape[1]}x{depths.shape[0]} pixels has a disparity: all are NaN"
        )
    shape = depths.shape
    trust = np.ascontiguousarray(confidence, dtype=np.float64)
    if trust.shape != shape:
        raise InputError(f"confidence has shape {trust.shape}, the disparity {shape}")
    if not ((trust >= 0) & (trust <= 1)).all():
        raise InputError(
            f"confidence must be in [0, 1] at every pixel, got {np.min(trust)} to {np.max(trust)}"
            f" with {int(np.isnan(trust).sum())} NaN"
        )
    slopes = np.ascontiguousarray(gradient, dtype=np.float64)
    if slopes.shape != (*shape, 2):
        raise InputError(f"gradient has shape {slopes.shape}, expected {(*shape, 2)} for this disparity")
    if np.isinf(slopes).any():
        raise InputError("gradient holds infinities; mark missing values by NaN")
    colors = np.ascontiguousarray(image)
    if colors.dtype != np.uint8 or colors.shape != (*shape, 3):
        got = f"{colors.dtype} {colors.shape}"
        raise InputError(f"the image must be uint8 of shape {(*shape, 3)}, as the disparity; got {got}")
    return depths, trust, slopes, colors


def _filled(disparity: Floats, unknown: NDArray[np.bool_]) -> Floats:
    """The disparity with every unknown value replaced by the nearest known one."""
    if not unknown.any():
        return disparity
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    filled: Floats = disparity[tuple(nearest)]
    return filled

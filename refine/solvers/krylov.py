"""Conjugate gradients and BiCGSTAB over stencil operators: float32, with the solution kept and judged in float64."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from refine.energy.affinity import Floats
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencil.operator import Singles, StencilOperator, System, crop

Preconditioner = Callable[[Singles, Singles], None]
"""Of a residual, a correction into the second array; both padded."""

_RENEWED = 1e-3
"""Each time the residual has shrunk by this factor it is worked out anew from the solution: the one that the
steps keep has then drifted by the rounding of far larger ones (van der Vorst and Ye 2000). Directions stay."""


@dataclass(frozen=True)
class Iterated:
    """What was reached."""

    x: Floats
    """Padded."""
    iterations: int
    residual: float
    """|b - A x|."""


def solve_iteratively(
    problem: Problem, system: System, tolerance: float, precondition: Preconditioner, max_iterations: int
) -> LinearSolution:
    """The problem's solution from its start on, until |b - A x| <= tolerance |b|; overwrites the system's
    residual."""
    size = system.size or 1.0
    reached = krylov(system.operator, system.residual, tolerance * size, precondition, max_iterations)
    relative = reached.residual / size
    x = crop(reached.x) + problem.start
    return LinearSolution(x, reached.iterations, relative, relative <= tolerance)


def krylov(
    operator: StencilOperator,
    b: Floats,
    target: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> Iterated:
    """Conjugate gradients for a symmetric operator, BiCGSTAB for another, from 0 until |b - A x| <= target.

    `b` is padded, and overwritten. A BiCGSTAB iteration costs about two of CG.
    """
    x = np.zeros(b.shape)
    size = math.sqrt(_dot(b, b))
    if not size > target:
        return Iterated(x, 0, size)
    b /= size  # so that tight tolerances do not sink below what float32 can hold
    method = _conjugate_gradients if operator.symmetric else _bicgstab
    with np.errstate(all="ignore"):  # a breakdown shows as a residual that is not finite
        iterations, residual = method(operator, b, x, target / size, precondition, max_iterations)
    x *= size
    return Iterated(x, iterations, residual * size)


def _conjugate_gradients(
    operator: StencilOperator,
    b: Floats,
    x: Floats,
    target: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> tuple[int, float]:
    residual = b.astype(np.float32)
    direction, product = np.zeros_like(residual), np.zeros_like(residual)
    norm = renewed = before = 1.0
    for iteration in range(max_iterations):
        if not norm > max(target, _RENEWED * renewed):
            norm = renewed = math.sqrt(operator.remainder(b, x, residual))
            if not norm > target:
                return iteration, norm
        correction = product  # the last product is done with
        precondition(residual, correction)
        energy = _dot(residual, correction)
        _advance(direction, correction, energy / before if iteration else 0.0)
        along, _ = operator.apply_against(direction, direction, product)
        norm = math.sqrt(_step(x, residual, direction, product, np.float32(energy / along)))
        before = energy
    return max_iterations, math.sqrt(operator.remainder(b, x, residual))


def _bicgstab(
    operator: StencilOperator,
    b: Floats,
    x: Floats,
    target: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> tuple[int, float]:
    """van der Vorst 1992, preconditioned from the right; the shadow residual is b."""
    residual = b.astype(np.float32)
    direction, product = np.zeros_like(residual), np.zeros_like(residual)
    half, second = np.zeros_like(residual), np.zeros_like(residual)
    norm = renewed = rho = alpha = omega = 1.0
    for iteration in range(max_iterations):
        if not norm > max(target, _RENEWED * renewed):
            norm = renewed = math.sqrt(operator.remainder(b, x, residual))
            if not norm > target:
                return iteration, norm
        before, rho = rho, _dot(b, residual)
        _redirect(direction, residual, product, (rho / before) * (alpha / omega), omega)
        precondition(direction, half)
        shadow, _ = operator.apply_against(half, b, product)
        alpha = rho / shadow
        norm = math.sqrt(_step(x, residual, half, product, np.float32(alpha)))
        if not norm > target:
            norm = renewed = math.sqrt(operator.remainder(b, x, residual))
            if not norm > target:
                return iteration + 1, norm
        precondition(residual, half)
        along, size = operator.apply_against(half, residual, second)
        omega = along / size
        norm = math.sqrt(_step(x, residual, half, second, np.float32(omega)))
    return max_iterations, math.sqrt(operator.remainder(b, x, residual))


@njit(cache=True, parallel=True, fastmath={"contract", "reassoc"})
def _dot(a, b):
    total = 0.0
    for y in prange(a.shape[0]):
        row = 0.0
        for x in range(a.shape[1]):
            row += np.float64(a[y, x]) * np.float64(b[y, x])
        total += row
    return total


@njit(cache=True, parallel=True)
def _advance(direction, correction, momentum):
    factor = np.float32(momentum)
    for y in prange(direction.shape[0]):
        for x in range(direction.shape[1]):
            direction[y, x] = correction[y, x] + factor * direction[y, x]


@njit(cache=True, parallel=True)
def _redirect(direction, residual, product, momentum, omega):
    """direction = residual + momentum (direction - omega product)."""
    factor, along = np.float32(momentum), np.float32(omega)
    for y in prange(direction.shape[0]):
        for x in range(direction.shape[1]):
            direction[y, x] = residual[y, x] + factor * (direction[y, x] - along * product[y, x])


@njit(cache=True, parallel=True, fastmath={"contract", "reassoc"})
def _step(x, residual, direction, product, step):
    """One step along `direction`; the squared norm of the new residual."""
    total = 0.0
    for y in prange(x.shape[0]):
        row = 0.0
        for j in range(x.shape[1]):
            x[y, j] += np.float64(step) * np.float64(direction[y, j])
            value = residual[y, j] - step * product[y, j]
            residual[y, j] = value
            row += np.float64(value) * np.float64(value)
        total += row
    return total

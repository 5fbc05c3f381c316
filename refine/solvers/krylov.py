"""Conjugate gradients and BiCGSTAB over stencil operators, in float64 with float32 coefficients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit, prange

from refine.solvers.linear import LinearSolution
from refine.solvers.stencils import Singles, StencilOperator, crop
from refine.weights import Floats

Preconditioner = Callable[[Singles], Singles]
"""Residual to correction, both padded; the correction may be overwritten by the next call."""


def krylov(
    operator: StencilOperator,
    right_hand_side: Floats,
    start: Floats,
    tolerance: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> LinearSolution:
    """Conjugate gradients for a symmetric operator, BiCGSTAB for another, until |b - A x| <= tolerance |b|.

    Arrays padded; `start` is overwritten. The preconditioner works in float32 on residuals scaled to norm 1, so
    that tight tolerances do not sink below its range. A BiCGSTAB iteration costs about two of CG.
    """
    method = _conjugate_gradients if operator.symmetric else _bicgstab
    size = float(np.linalg.norm(right_hand_side)) or 1.0
    x = start
    with np.errstate(all="ignore"):  # a breakdown shows as a residual that is not finite
        iterations = method(operator, right_hand_side, x, tolerance * size, precondition, max_iterations)
    residual = np.zeros_like(x)
    operator.apply(x, residual)
    # The recurrence's own residual drifts from the true one, so convergence is judged by the true one.
    relative = float(np.linalg.norm(right_hand_side - residual)) / size
    return LinearSolution(np.ascontiguousarray(crop(x)), iterations, relative, relative <= 2 * tolerance)


def _conjugate_gradients(
    operator: StencilOperator,
    b: Floats,
    x: Floats,
    target: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> int:
    product, direction = np.zeros_like(x), np.zeros_like(x)
    operator.apply(x, product)
    residual = b - product
    norm = float(np.linalg.norm(residual))
    before = 1.0
    for iteration in range(max_iterations):
        if not norm > target:
            return iteration
        correction = _scaled(precondition, residual, norm)
        energy = norm * _dot(residual, correction)
        _advance(direction, correction, norm, energy / before if iteration else 0.0)
        operator.apply(direction, product)
        step = energy / _dot(direction, product)
        norm = float(np.sqrt(_step(x, residual, direction, product, step)))
        before = energy
    return max_iterations


def _bicgstab(
    operator: StencilOperator,
    b: Floats,
    x: Floats,
    target: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> int:
    """van der Vorst 1992, preconditioned from the right."""
    product, second, direction = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    operator.apply(x, second)
    residual = b - second
    shadow = residual.copy()
    norm = float(np.linalg.norm(residual))
    rho = alpha = omega = 1.0
    for iteration in range(max_iterations):
        if not norm > target:
            return iteration
        before, rho = rho, _dot(shadow, residual)
        # direction = residual + beta (direction - omega product)
        direction -= omega * product
        direction *= (rho / before) * (alpha / omega)
        direction += residual
        size = float(np.linalg.norm(direction))
        half = _scaled(precondition, direction, size).astype(np.float64) * size
        operator.apply(half, product)
        alpha = rho / _dot(shadow, product)
        x += alpha * half
        residual -= alpha * product
        norm = float(np.linalg.norm(residual))
        if not norm > target:
            return iteration + 1
        half = _scaled(precondition, residual, norm).astype(np.float64) * norm
        operator.apply(half, second)
        omega = _dot(second, residual) / _dot(second, second)
        x += omega * half
        residual -= omega * second
        norm = float(np.linalg.norm(residual))
    return max_iterations


def _scaled(precondition: Preconditioner, residual: Floats, norm: float) -> Singles:
    scaled = np.empty(residual.shape, np.float32)
    _scale(residual, 1 / norm, scaled)
    return precondition(scaled)


@njit(cache=True, parallel=True)
def _scale(x, factor, out):
    for y in prange(x.shape[0]):
        for j in range(x.shape[1]):
            out[y, j] = factor * x[y, j]


@njit(cache=True, parallel=True)
def _dot(a, b):
    total = 0.0
    for y in prange(a.shape[0]):
        row = 0.0
        for x in range(a.shape[1]):
            row += a[y, x] * b[y, x]
        total += row
    return total


@njit(cache=True, parallel=True)
def _advance(direction, correction, scale, momentum):
    for y in prange(direction.shape[0]):
        for x in range(direction.shape[1]):
            direction[y, x] = scale * correction[y, x] + momentum * direction[y, x]


@njit(cache=True, parallel=True)
def _step(x, residual, direction, product, step):
    """One step along `direction`; the squared norm of the new residual."""
    total = 0.0
    for y in prange(x.shape[0]):
        row = 0.0
        for j in range(x.shape[1]):
            x[y, j] += step * direction[y, j]
            value = residual[y, j] - step * product[y, j]
            residual[y, j] = value
            row += value * value
        total += row
    return total

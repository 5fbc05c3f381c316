"""Conjugate gradients and BiCGSTAB on stencil operators: float32 vectors, the solution summed and judged in float64."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from refine.energy.affinity import Floats
from refine.solvers.arrays import Float32Array
from refine.solvers.linear import LinearSolution, Problem
from refine.solvers.stencil.operator import StencilOperator
from refine.solvers.stencil.padding import crop
from refine.solvers.stencil.right_hand_side import StencilSystem
from stereoforge_kit.kernels import njit, prange

Preconditioner = Callable[[Float32Array, Float32Array], None]
"""(residual, out): writes M^-1 residual into `out`; both (H, W), padded."""

_REPLACEMENT = 1e-3
"""Each time the residual has shrunk by this factor it is computed anew from the solution: the recurrence's residual has
then drifted by the rounding of far larger ones (residual replacement: H. A. van der Vorst, Q. Ye, SIAM J. Sci. Comput.
22 (3), 2000). Search directions are kept."""


@dataclass(frozen=True)
class KrylovResult:
    """What the iterations reached."""

    x: Floats
    """(H, W), padded."""
    iterations: int
    residual_norm: float
    """|b - A x|."""


def solve_iteratively(
    problem: Problem,
    system: StencilSystem,
    tolerance: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> LinearSolution:
    """Solve a refinement from its start on, until |b - A x| <= tolerance |b|.

    Args:
        problem: The refinement.
        system: Its system; `residual` is overwritten.
        tolerance: Relative residual; an absolute one where b is 0.
        precondition: The preconditioner.
        max_iterations: After which it gives up, with `converged` False.
    """
    norm = system.right_hand_side_norm or 1.0
    result = krylov(system.operator, system.residual, tolerance * norm, precondition, max_iterations)
    relative = result.residual_norm / norm
    x = crop(result.x) + problem.start
    return LinearSolution(x, result.iterations, relative, relative <= tolerance)


def krylov(
    operator: StencilOperator,
    b: Floats,
    target: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> KrylovResult:
    """Solve A x = b from 0 by CG where A is symmetric, by BiCGSTAB where not; an iteration of BiCGSTAB costs two of CG.

    Args:
        operator: A.
        b: (H, W), padded; overwritten.
        target: |b - A x| at which the iterations stop.
        precondition: The preconditioner, symmetric where A is.
        max_iterations: After which they stop in any case.
    """
    x = np.zeros(b.shape)
    norm = math.sqrt(_dot(b, b))
    if not norm > target:
        return KrylovResult(x, 0, norm)
    b /= norm  # so that tight tolerances do not sink below what float32 can hold
    method = _conjugate_gradients if operator.symmetric else _bicgstab
    with np.errstate(all="ignore"):  # a breakdown shows as a residual that is not finite
        iterations, residual_norm = method(operator, b, x, target / norm, precondition, max_iterations)
    x *= norm
    return KrylovResult(x, iterations, residual_norm * norm)


def _conjugate_gradients(
    operator: StencilOperator,
    b: Floats,
    x: Floats,
    target: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> tuple[int, float]:
    """Preconditioned CG (Y. Saad, Iterative Methods for Sparse Linear Systems, 2nd ed., SIAM 2003, Algorithm 9.1), its
    lines in the comments; the number of iterations and |b - A x|."""
    r = b.astype(np.float32)
    p, product = np.zeros_like(r), np.zeros_like(r)
    norm = replaced = rz_before = 1.0
    for iteration in range(max_iterations):
        if not norm > max(target, _REPLACEMENT * replaced):
            norm = replaced = math.sqrt(operator.residual(b, x, r))
            if not norm > target:
                return iteration, norm
        z = product  # A p is no longer needed
        precondition(r, z)  # 6: z = M^-1 r
        rz = _dot(r, z)
        _update_direction(p, z, rz / rz_before if iteration else 0.0)  # 7, 8: p = z + beta p
        p_ap, _ = operator.apply_and_dot(p, p, product)
        alpha = rz / p_ap  # 3
        norm = math.sqrt(_step(x, r, p, product, np.float32(alpha)))  # 4, 5: x += alpha p, r -= alpha A p
        rz_before = rz
    return max_iterations, math.sqrt(operator.residual(b, x, r))


def _bicgstab(
    operator: StencilOperator,
    b: Floats,
    x: Floats,
    target: float,
    precondition: Preconditioner,
    max_iterations: int,
) -> tuple[int, float]:
    """BiCGSTAB, preconditioned from the right (H. A. van der Vorst, SIAM J. Sci. Stat. Comput. 13 (2), 1992; R. Barrett
    et al., Templates for the Solution of Linear Systems, SIAM 1994, Fig. 2.10); the number of iterations and
    |b - A x|.

    The shadow residual r~ is b.
    """
    r = b.astype(np.float32)
    p, v = np.zeros_like(r), np.zeros_like(r)
    preconditioned, t = np.zeros_like(r), np.zeros_like(r)
    norm = replaced = rho = alpha = omega = 1.0
    for iteration in range(max_iterations):
        if not norm > max(target, _REPLACEMENT * replaced):
            norm = replaced = math.sqrt(operator.residual(b, x, r))
            if not norm > target:
                return iteration, norm
        rho_before, rho = rho, _dot(b, r)
        beta = (rho / rho_before) * (alpha / omega)
        _update_bicgstab_direction(p, r, v, beta, omega)  # p = r + beta (p - omega v)
        precondition(p, preconditioned)
        shadow_v, _ = operator.apply_and_dot(preconditioned, b, v)  # v = A M^-1 p
        alpha = rho / shadow_v
        # s = r - alpha v, kept in r; x += alpha M^-1 p
        norm = math.sqrt(_step(x, r, preconditioned, v, np.float32(alpha)))
        if not norm > target:
            norm = replaced = math.sqrt(operator.residual(b, x, r))
            if not norm > target:
                return iteration + 1, norm
        precondition(r, preconditioned)
        ts, tt = operator.apply_and_dot(preconditioned, r, t)  # t = A M^-1 s
        omega = ts / tt
        # r = s - omega t; x += omega M^-1 s
        norm = math.sqrt(_step(x, r, preconditioned, t, np.float32(omega)))
    return max_iterations, math.sqrt(operator.residual(b, x, r))


@njit(parallel=True, fastmath={"contract", "reassoc"})
def _dot(a, b):
    """In float64."""
    total = 0.0
    for y in prange(a.shape[0]):
        row = 0.0
        for x in range(a.shape[1]):
            row += np.float64(a[y, x]) * np.float64(b[y, x])
        total += row
    return total


@njit(parallel=True)
def _update_direction(direction, correction, beta):
    """direction = correction + beta direction."""
    factor = np.float32(beta)
    for y in prange(direction.shape[0]):
        for x in range(direction.shape[1]):
            direction[y, x] = correction[y, x] + factor * direction[y, x]


@njit(parallel=True)
def _update_bicgstab_direction(direction, residual, product, beta, omega):
    """direction = residual + beta (direction - omega product)."""
    factor, along = np.float32(beta), np.float32(omega)
    for y in prange(direction.shape[0]):
        for x in range(direction.shape[1]):
            direction[y, x] = residual[y, x] + factor * (direction[y, x] - along * product[y, x])


@njit(parallel=True, fastmath={"contract", "reassoc"})
def _step(x, residual, direction, product, step):
    """x += step direction, residual -= step product; the squared norm of the new residual."""
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

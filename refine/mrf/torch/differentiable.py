"""The refinement in torch, batched and differentiable: what networks are trained through.

The solution S of A S = b depends on everything A and b are made of. By the implicit function theorem the
gradient of a loss with respect to any of it costs one more solve: with A' lambda = dLoss/dS,

    dLoss/dtheta = lambda' (db/dtheta - dA/dtheta S),

whatever the solver, and with no memory kept of its iterations. On CPUs the exact form, which is its own transpose, is
solved by the kernels of `refine.solvers`, a sample at a time; the paper's form, and either on other devices, by torch's
own operations, the batch at once (a CPU takes fifteen to thirty times as long for that). Needs torch, which
`import refine` does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn.functional import pad

from refine.energy.affinity import NEIGHBORS
from refine.energy.parameters import MRFParameters
from refine.energy.system import Form
from refine.mrf.torch.aggregation import AggregationCycle
from refine.solvers import SolverError
from refine.solvers.multigrid import MultigridSolver
from refine.solvers.stencil.padding import crop
from refine.solvers.stencil.padding import pad as padded
from refine.solvers.stencil.weights import StencilWeights
from stereoforge_kit.errors import InputError

Map = Callable[[Tensor], Tensor]

DEFAULT_TOLERANCE = 1e-6
"""Relative residual."""
MAX_ITERATIONS = 1000
MAX_ROUNDS = 20
"""Solves of what is left of a residual."""
_SINGLE = 1e-6
"""Share of a residual that is worth solving for with float32 coefficients."""


@dataclass(frozen=True)
class ImageWeights:
    """Affinities of a batch, as `refine.energy.affinity` or a network gives them."""

    phi_x: Tensor
    """(B, H, W)."""
    phi_y: Tensor
    """(B, H, W)."""
    neighbors: Tensor
    """(B, 8, H, W), in the order of `refine.energy.affinity.NEIGHBORS`; 0 towards neighbours outside the image."""


def image_weights(image: Tensor, sigma_r: float, dtype: torch.dtype = torch.float32) -> ImageWeights:
    """`refine.energy.affinity.edge_weights` and `neighbor_weights` for (B, 3, H, W) images in 0..255."""
    values = image.to(dtype)
    falloff = 0.5 / sigma_r**2
    across = (values.diff(dim=3) ** 2).sum(1)
    downwards = (values.diff(dim=2) ** 2).sum(1)
    grey = values.mean(1) / 255
    inside = torch.stack([_neighbor(torch.ones_like(grey), k) for k in range(8)], 1)
    difference = torch.stack([_neighbor(grey, k) for k in range(8)], 1) - grey[:, None]
    difference = difference * inside
    squared = difference**2
    count = 1 + inside.sum(1)
    variance = squared.sum(1) / count - (difference.sum(1) / count) ** 2
    nearest = torch.where(inside > 0, squared, torch.inf).amin(1)
    nearest = torch.where(nearest.isfinite(), nearest, torch.zeros_like(nearest))
    scale = torch.maximum(0.6 * variance, -nearest / math.log(0.01)).clamp(min=2e-6)
    raw = torch.exp(-squared / scale[:, None]) * inside
    return ImageWeights(
        phi_x=pad(torch.exp(-falloff * across), (0, 1), value=1.0),
        phi_y=pad(torch.exp(-falloff * downwards), (0, 0, 0, 1), value=1.0),
        neighbors=raw / raw.sum(1, keepdim=True).clamp(min=torch.finfo(dtype).tiny),
    )


def refine_batch(
    disparity: Tensor,
    confidence: Tensor,
    gradient: Tensor,
    weights: ImageWeights,
    parameters: MRFParameters = MRFParameters(),  # noqa: B008 - frozen
    form: Form = "exact",
    tolerance: float = DEFAULT_TOLERANCE,
) -> Tensor:
    """`refine.refine_disparity` for a batch, differentiable in every tensor.

    Args:
        disparity: (B, H, W), finite.
        confidence: (B, H, W) in [0, 1]; no gradient flows where the confidence floor holds.
        gradient: (B, 2, H, W) [dx, dy]; NaN leaves that difference free.
        weights: Of the images; `image_weights` gives them.
        parameters: The energy's weights.
        form: "exact" or "paper".
        tolerance: Relative residual of each sample's solve, here and backwards.

    Returns:
        (B, H, W) refined disparity.

    Raises:
        ValueError: If shapes do not fit together or a disparity is not finite.
        refine.SolverError: If a solve does not reach the tolerance.
    """
    batch, height, width = disparity.shape
    if confidence.shape != disparity.shape or gradient.shape != (batch, 2, height, width):
        raise InputError(
            f"disparity {tuple(disparity.shape)}, confidence {tuple(confidence.shape)} and gradient "
            f"{tuple(gradient.shape)} do not fit; expected (B, H, W), (B, H, W), (B, 2, H, W)"
        )
    if not disparity.isfinite().all():
        raise InputError("disparity must be finite; fill what is missing and give it confidence 0")
    tau = confidence.clamp(min=parameters.confidence_floor)
    known = gradient.isfinite()
    wanted = torch.where(known, gradient, torch.zeros_like(gradient))
    axial_x = parameters.alpha * (weights.phi_x * known[:, 0])[:, :, :-1]
    axial_y = parameters.alpha * (weights.phi_y * known[:, 1])[:, :-1, :]
    color = parameters.beta * (2 - weights.phi_x - weights.phi_y)
    b = tau * disparity
    b = b + _spread_x(axial_x * wanted[:, 0, :, :-1]) + _spread_y(axial_y * wanted[:, 1, :-1, :])
    parts = (tau, axial_x, axial_y, color, weights.neighbors, b)
    solved: Tensor = _Solve.apply(form, tolerance, disparity.detach(), *parts)  # type: ignore[no-untyped-call]
    return solved


def _neighbor(x: Tensor, k: int) -> Tensor:
    """At each pixel the value of its k-th neighbour, 0 outside the image."""
    (dy, dx), (height, width) = NEIGHBORS[k], x.shape[-2:]
    return pad(x, (1, 1, 1, 1))[..., 1 + dy : 1 + dy + height, 1 + dx : 1 + dx + width]


def _spread_x(flow: Tensor) -> Tensor:
    """Cx' flow: from each pixel to its right neighbour."""
    return pad(flow, (1, 0)) - pad(flow, (0, 1))


def _spread_y(flow: Tensor) -> Tensor:
    return pad(flow, (0, 0, 1, 0)) - pad(flow, (0, 0, 0, 1))


def _laplacian(w: Tensor, x: Tensor) -> Tensor:
    """L x = x - W x."""
    return x - sum((w[:, k] * _neighbor(x, k) for k in range(8)), torch.zeros_like(x))


def _laplacian_transposed(w: Tensor, x: Tensor) -> Tensor:
    """L' x: pixel q gets w_pq x_p from each p that has it as a neighbour; seen from q, p has number 7 - k."""
    return x - sum((_neighbor(w[:, k] * x, 7 - k) for k in range(8)), torch.zeros_like(x))


def _apply(form: Form, transposed: bool, parts: tuple[Tensor, ...], x: Tensor) -> Tensor:
    """A x or A' x."""
    tau, axial_x, axial_y, color, w = parts
    result = tau * x + _spread_x(axial_x * x.diff(dim=2)) + _spread_y(axial_y * x.diff(dim=1))
    if form == "exact":
        return result + _laplacian_transposed(w, color * _laplacian(w, x))
    if transposed:
        return result + _laplacian_transposed(w, color * x)
    return result + color * _laplacian(w, x)


def _diagonal(form: Form, parts: tuple[Tensor, ...]) -> Tensor:
    tau, axial_x, axial_y, color, w = parts
    result = tau + color + pad(axial_x, (1, 0)) + pad(axial_x, (0, 1))
    result = result + pad(axial_y, (0, 0, 1, 0)) + pad(axial_y, (0, 0, 0, 1))
    if form == "exact":
        for k in range(8):
            result = result + _neighbor(w[:, k] ** 2 * color, 7 - k)
    return result


class _Solve(torch.autograd.Function):
    """(form, tolerance, start, parts of A, b) -> S."""

    @staticmethod
    def forward(ctx: Any, form: Form, tolerance: float, start: Tensor, *parts: Tensor) -> Tensor:
        system = _System(form, parts[:-1])
        x = system.solve(parts[-1], start, tolerance)
        ctx.form, ctx.tolerance, ctx.system = form, tolerance, system
        ctx.save_for_backward(x, *parts)
        return x

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor | None, ...]:
        x, *saved = ctx.saved_tensors
        adjoint = ctx.system.solve(slope, torch.zeros_like(slope), ctx.tolerance, transposed=True)
        with torch.enable_grad():
            parts = tuple(part.detach().requires_grad_() for part in saved)
            residual = parts[-1] - _apply(ctx.form, False, parts[:-1], x)
        return None, None, None, *torch.autograd.grad(residual, parts, adjoint)


class _System:
    """A, and what its solves have in common: the multigrid hierarchy serves backwards too.

    The vectors of the iterations are float64 and the preconditioner float32: in float32 the residual of a whole
    frame stops at 1e-4 by the rounding of the disparities alone.
    """

    def __init__(self, form: Form, parts: tuple[Tensor, ...]) -> None:
        self._form = form
        self._parts = tuple(part.detach().double() for part in parts)
        self._singles = tuple(part.float() for part in self._parts)
        self._cycles: dict[bool, AggregationCycle] = {}
        self._kernels: list[MultigridSolver] = []

    def solve(self, b: Tensor, start: Tensor, tolerance: float, transposed: bool = False) -> Tensor:
        """A x = b, or A' x = b, in b's precision; raises SolverError where the tolerance is not reached."""

        def apply(x: Tensor) -> Tensor:
            return _apply(self._form, transposed, self._parts, x)

        wanted = b.double()
        norm = _norm(wanted)
        if _has_kernels(self._form, wanted):
            x = self._solve_by_kernels(apply, wanted, start.double(), tolerance * norm)
        else:
            cycle = self._cycle(transposed and self._form == "paper")
            method = _conjugate_gradients if self._form == "exact" else _bicgstab
            x = method(apply, lambda r: cycle(r.float()).double(), wanted, start.double(), tolerance)
        relative = _norm(wanted - apply(x)) / torch.where(norm > 0, norm, 1)
        # The recurrence's residual drifts from the true one by rounding.
        if not bool((relative <= max(2 * tolerance, 1e-12)).all()):
            raise SolverError(
                f"the batched MRF solve stopped at a relative residual of {float(relative.max()):.1e}, "
                f"short of {tolerance:.1e}; use a larger tolerance"
            )
        return x.to(b.dtype)

    def _solve_by_kernels(self, apply: Map, b: Tensor, x: Tensor, target: Tensor) -> Tensor:
        """By `refine.solvers`, a sample at a time.

        Its coefficients are float32, so the residual of its solution is solved for again.
        """
        if not all(bool(part.isfinite().all()) for part in self._singles):
            return x  # which is then found to be no solution
        if not self._kernels:
            self._kernels = [
                MultigridSolver(_stencil_weights(*sample)) for sample in zip(*self._singles, strict=True)
            ]
        for _ in range(MAX_ROUNDS):
            residual = b - apply(x)
            norm = _norm(residual)
            open_ = torch.nonzero(norm.flatten() > target.flatten()).flatten().tolist()
            if not open_:
                break
            x = x.clone()
            for i in open_:
                share = max(float(target[i] / norm[i]) / 2, _SINGLE)
                found = self._kernels[i].solve(padded(residual[i].numpy(), np.float64), share)
                x[i] += torch.from_numpy(crop(found.x))
        return x

    def _cycle(self, transposed: bool) -> AggregationCycle:
        if transposed not in self._cycles:
            self._cycles[transposed] = AggregationCycle(
                self._singles,
                lambda x: _apply(self._form, transposed, self._singles, x),
                _diagonal(self._form, self._singles),
            )
        return self._cycles[transposed]


def _has_kernels(form: Form, b: Tensor) -> bool:
    return form == "exact" and b.device.type == "cpu"


def _stencil_weights(
    tau: Tensor, axial_x: Tensor, axial_y: Tensor, color: Tensor, weights: Tensor
) -> StencilWeights:
    """Of one sample, as `refine.solvers` has them."""
    axial = torch.stack([pad(axial_x, (0, 1)), pad(axial_y, (0, 0, 0, 1))])
    weights = weights * torch.stack([_neighbor(torch.ones_like(tau), k) for k in range(8)])
    return StencilWeights(*(padded(part.numpy()) for part in (tau, weights, axial, color)))


def _dot(a: Tensor, b: Tensor) -> Tensor:
    return (a * b).sum((1, 2), keepdim=True)


def _norm(a: Tensor) -> Tensor:
    return _dot(a, a).sqrt()


def _ratio(a: Tensor, b: Tensor) -> Tensor:
    """a / b, 0 where b is 0: for samples that are already solved."""
    return torch.where(b != 0, a / torch.where(b != 0, b, 1), 0)


def _conjugate_gradients(apply: Map, precondition: Map, b: Tensor, start: Tensor, tolerance: float) -> Tensor:
    """Every sample with its own steps."""
    x, target = start.clone(), tolerance * _norm(b)
    residual = b - apply(x)
    direction = correction = precondition(residual)
    energy = _dot(residual, correction)
    for _ in range(MAX_ITERATIONS):
        open_ = _norm(residual) > target
        if not bool(open_.any()):
            break
        product = apply(direction)
        step = _ratio(energy, _dot(direction, product)) * open_
        x = x + step * direction
        residual = residual - step * product
        correction = precondition(residual)
        before, energy = energy, _dot(residual, correction)
        direction = correction + _ratio(energy, before) * direction
    return x


def _bicgstab(apply: Map, precondition: Map, b: Tensor, start: Tensor, tolerance: float) -> Tensor:
    """van der Vorst 1992, preconditioned from the right, every sample with its own steps."""
    x, target = start.clone(), tolerance * _norm(b)
    residual = b - apply(x)
    shadow, direction, product = residual, torch.zeros_like(b), torch.zeros_like(b)
    rho = alpha = omega = torch.ones_like(_norm(b))
    for _ in range(MAX_ITERATIONS):
        open_ = _norm(residual) > target
        if not bool(open_.any()):
            break
        before, rho = rho, _dot(shadow, residual)
        direction = residual + _ratio(rho, before) * _ratio(alpha, omega) * (direction - omega * product)
        half = precondition(direction)
        product = apply(half)
        alpha = _ratio(rho, _dot(shadow, product)) * open_
        x = x + alpha * half
        residual = residual - alpha * product
        half = precondition(residual)
        second = apply(half)
        omega = _ratio(_dot(second, residual), _dot(second, second)) * open_
        x = x + omega * half
        residual = residual - omega * second
    return x

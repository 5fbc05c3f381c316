"""Total generalised variation with an image-driven tensor: piecewise planar surfaces that break at image edges.

D. Ferstl, C. Reinbacher, R. Ranftl, M. Ruether, H. Bischof, "Image guided depth upsampling using anisotropic total
generalized variation", ICCV 2013; solved by T. Pock, A. Chambolle, "Diagonal preconditioning for first order
primal-dual algorithms in convex optimization", ICCV 2011.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from refine.energy.confidence_shape import ConfidenceShape
from refine.method import EvaluationFrame, Method, MethodOutput
from stereoforge_kit.errors import InputError
from stereoforge_kit.kernels import njit, prange
from stereoforge_kit.matching import fill_nearest

Map = NDArray[np.float32]

_CHECK_EVERY = 10
"""Iterations between looks at how far the disparity still moves."""


@dataclass(frozen=True)
class TGV(Method):
    """min over u, v of alpha1 sum |T^(1/2) (grad u - v)| + alpha0 sum |grad v| + 1/2 sum w (u - d)^2.

    v is the field of slopes, grad takes forward differences inside the image, |.| is the Euclidean norm at a pixel,
    w = data_weight tau, and T^(1/2) = exp(-b |grad I|^g) n n' + m m' with n the direction of the image's gradient
    and m across it. The weights are the published demo's. What differs: the published w is lambda = 40 on depth
    scaled to 0..1 (here 0.4 on pixels, the same for a range of 100 px); no gradient term where a difference leaves
    the image; the tensor's settings are the ones the demo names (its code ignores them and takes 10 and 0.75); and
    steps that provably converge (Pock and Chambolle's, where the published code accelerates heuristically).
    """

    name: ClassVar[str] = "tgv"
    label: ClassVar[str] = "TGV-L2"
    needs: ClassVar[frozenset[str]] = frozenset({"confidence"})
    search: ClassVar = {
        "data_weight": (0.01, 0.03, 0.1, 0.4, 1.6, 6.4),
        "alpha1": (0.3, 0.6, 1.2, 2.4, 4.8),
        "alpha0": (4.0, 8.0, 17.0, 34.0),
        "tensor_strength": (2.0, 9.0, 30.0),
        "shape.power": (0.5, 1.0, 2.0, 3.0, 4.0),
    }

    alpha1: float = 1.2
    """Weight of first differences that the slopes do not explain."""
    alpha0: float = 17.0
    """Weight of changes of the slopes."""
    data_weight: float = 0.4
    """Lambda, a square pixel."""
    tensor_strength: float = 9.0
    """b, for a grey image in 0..1."""
    tensor_exponent: float = 0.85
    """g."""
    shape: ConfidenceShape = field(default_factory=ConfidenceShape)
    iterations: int = 500
    """At most; the published demo makes 200, starting close to the solution."""
    tolerance_px: float = 1e-3
    """The iteration ends when the disparity moves by less than this in 10 iterations, on average."""

    def __post_init__(self) -> None:
        for name in ("alpha1", "alpha0", "data_weight", "tensor_exponent", "iterations"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"TGV's {name} must be positive, got {value}")
        if not self.tensor_strength >= 0:
            raise InputError(f"TGV's tensor_strength must be at least 0, got {self.tensor_strength}")

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Minimise the energy from the frame's initial disparity, weighted by its confidence."""
        assert frame.confidence is not None
        trust = np.where(np.isnan(frame.disparity), 0, self.shape.apply(frame.confidence))
        disparity, _ = self.solve(fill_nearest(frame.disparity), trust.astype(np.float32), frame.image)
        return MethodOutput(disparity)

    def solve(self, target: Map, confidence: Map, image: NDArray[np.uint8]) -> tuple[Map, Map]:
        """Disparity u (H, W) and slopes v (H, W, 2) for a finite target."""
        tensor = edge_tensor(image, self.tensor_strength, self.tensor_exponent)
        steps = _Steps.of(tensor, self.alpha1, self.alpha0)
        weight = np.float32(self.data_weight) * confidence
        target = np.ascontiguousarray(target, np.float32)
        u, bar_u = target.copy(), target.copy()
        v, bar_v, p = (np.zeros((*target.shape, 2), np.float32) for _ in range(3))
        q = np.zeros((*target.shape, 4), np.float32)
        before = u.copy()
        for iteration in range(1, self.iterations + 1):
            _ascend(bar_u, bar_v, p, q, tensor, steps.p, steps.q, self.alpha1, self.alpha0)
            _descend(
                u, v, bar_u, bar_v, p, q, tensor, weight, target, steps.u, steps.v, self.alpha1, self.alpha0
            )
            if iteration % _CHECK_EVERY == 0:
                if float(np.abs(u - before).mean()) < self.tolerance_px:
                    break
                before = u.copy()
        return u, v

    def energy(self, u: Map, v: Map, target: Map, confidence: Map, image: NDArray[np.uint8]) -> float:
        """What is minimised; shapes as for `solve`."""
        tensor = edge_tensor(image, self.tensor_strength, self.tensor_exponent).astype(np.float64)
        rest = _forward(u.astype(np.float64)) - v
        rest[:, -1, 0] = 0
        rest[-1, :, 1] = 0
        along, across = _through(tensor, rest)
        bends = [_forward(v[..., c].astype(np.float64)) for c in (0, 1)]
        bend = np.sqrt(sum((b**2).sum(axis=2) for b in bends))
        data = 0.5 * self.data_weight * (confidence * (u.astype(np.float64) - target) ** 2)
        return float((self.alpha1 * np.hypot(along, across) + self.alpha0 * bend + data).sum())


def edge_tensor(image: NDArray[np.uint8], strength: float, exponent: float) -> Map:
    """T^(1/2) of `TGV` as (H, W, 3): its entries xx, yy, xy.

    The image is grey, 0..1, smoothed by a Gaussian of 0.5 px; its differences are forward ones.
    """
    grey = gaussian_filter(image.mean(axis=2) / 255, 0.5, mode="nearest")
    slope = _forward(grey)
    size = np.hypot(slope[..., 0], slope[..., 1])
    flat = size < 1e-8
    normal = np.where(flat[..., None], [1.0, 0.0], slope / np.where(flat, 1.0, size)[..., None])
    weight = np.maximum(np.exp(-strength * size**exponent), 1e-8)
    nx, ny = normal[..., 0], normal[..., 1]
    return np.stack(
        [weight * nx**2 + ny**2, weight * ny**2 + nx**2, (weight - 1) * nx * ny], axis=2, dtype=np.float32
    )


@dataclass(frozen=True)
class _Steps:
    """Step sizes of Pock and Chambolle's Lemma 2: one over the sums of the operator's rows and columns."""

    p: Map
    q: float
    u: Map
    v: Map

    @classmethod
    def of(cls, tensor: Map, alpha1: float, alpha0: float) -> _Steps:
        xx, yy, xy = (np.abs(tensor[..., c]) for c in range(3))
        # The rows of a pixel's p, which is projected as a whole and so has one step size.
        rows_p = alpha1 * 3 * (np.maximum(xx, yy) + xy)
        columns = np.stack([xx + xy, yy + xy], axis=2)
        columns_u = columns.sum(axis=2)
        columns_u[:, 1:] += columns[:, :-1, 0]
        columns_u[1:, :] += columns[:-1, :, 1]
        columns_v = (alpha1 * columns + 4 * alpha0).max(axis=2)
        return cls(
            p=(1 / rows_p).astype(np.float32),
            q=1 / (2 * alpha0),
            u=(1 / (alpha1 * columns_u)).astype(np.float32),
            v=(1 / columns_v).astype(np.float32),
        )


def _forward(values: NDArray[Any]) -> NDArray[Any]:
    """(H, W) to (H, W, 2) forward differences [dx, dy], 0 where they leave the image."""
    return np.stack(
        [np.diff(values, axis=axis, append=np.take(values, [-1], axis=axis)) for axis in (1, 0)], axis=2
    )


def _through(tensor: NDArray[Any], vectors: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    xx, yy, xy = (tensor[..., c] for c in range(3))
    x, y = vectors[..., 0], vectors[..., 1]
    return xx * x + xy * y, xy * x + yy * y


_MAP, _FIELD = "f4[:,::1]", "f4[:,:,::1]"


@njit(f"void({_MAP},{_FIELD},{_FIELD},{_FIELD},{_FIELD},{_MAP},f4,f4,f4)", parallel=True)
def _ascend(u, v, p, q, tensor, step_p, step_q, alpha1, alpha0):  # type: ignore[no-untyped-def]
    """p and q go up the gradient at (u, v) and back into their unit balls."""
    height, width = u.shape
    zero, one = np.float32(0), np.float32(1)
    for y in prange(height):
        for x in range(width):
            right, below = x + 1 < width, y + 1 < height
            a = u[y, x + 1] - u[y, x] - v[y, x, 0] if right else zero
            b = u[y + 1, x] - u[y, x] - v[y, x, 1] if below else zero
            xx, yy, xy = tensor[y, x, 0], tensor[y, x, 1], tensor[y, x, 2]
            step = step_p[y, x] * alpha1
            p0 = p[y, x, 0] + step * (xx * a + xy * b)
            p1 = p[y, x, 1] + step * (xy * a + yy * b)
            size = max(one, np.sqrt(p0 * p0 + p1 * p1))
            p[y, x, 0], p[y, x, 1] = p0 / size, p1 / size
            step = step_q * alpha0
            q0, q1, q2, q3 = q[y, x, 0], q[y, x, 1], q[y, x, 2], q[y, x, 3]
            if right:
                q0 += step * (v[y, x + 1, 0] - v[y, x, 0])
                q1 += step * (v[y, x + 1, 1] - v[y, x, 1])
            if below:
                q2 += step * (v[y + 1, x, 0] - v[y, x, 0])
                q3 += step * (v[y + 1, x, 1] - v[y, x, 1])
            size = max(one, np.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3))
            q[y, x, 0], q[y, x, 1], q[y, x, 2], q[y, x, 3] = q0 / size, q1 / size, q2 / size, q3 / size


@njit(
    f"void({_MAP},{_FIELD},{_MAP},{_FIELD},{_FIELD},{_FIELD},{_FIELD},{_MAP},{_MAP},{_MAP},{_MAP},f4,f4)",
    parallel=True,
)
def _descend(u, v, bar_u, bar_v, p, q, tensor, weight, target, step_u, step_v, alpha1, alpha0):  # type: ignore[no-untyped-def]
    """u and v go down the gradient of the coupling with (p, q), u also to its data; bar_* extrapolate."""
    height, width = u.shape
    zero = np.float32(0)
    for y in prange(height):
        for x in range(width):
            right, below = x + 1 < width, y + 1 < height
            px = tensor[y, x, 0] * p[y, x, 0] + tensor[y, x, 2] * p[y, x, 1] if right else zero
            py = tensor[y, x, 2] * p[y, x, 0] + tensor[y, x, 1] * p[y, x, 1] if below else zero
            divergence = px + py
            if x > 0:
                divergence -= tensor[y, x - 1, 0] * p[y, x - 1, 0] + tensor[y, x - 1, 2] * p[y, x - 1, 1]
            if y > 0:
                divergence -= tensor[y - 1, x, 2] * p[y - 1, x, 0] + tensor[y - 1, x, 1] * p[y - 1, x, 1]
            pull = step_u[y, x] * weight[y, x]
            old = u[y, x]
            new = (old + step_u[y, x] * alpha1 * divergence + pull * target[y, x]) / (np.float32(1) + pull)
            u[y, x] = new
            bar_u[y, x] = new + new - old
            for c in range(2):
                bend = q[y, x, c] if right else zero
                bend += q[y, x, 2 + c] if below else zero
                if x > 0:
                    bend -= q[y, x - 1, c]
                if y > 0:
                    bend -= q[y - 1, x, 2 + c]
                slope = px if c == 0 else py
                old = v[y, x, c]
                new = old + step_v[y, x] * (alpha1 * slope + alpha0 * bend)
                v[y, x, c] = new
                bar_v[y, x, c] = new + new - old

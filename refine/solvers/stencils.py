"""The MRF's operators as stencils on the image grid: built, and applied, without a sparse matrix.

Every plane and every vector has a border of `MARGIN` zeros, so that no kernel asks where the image ends.
Coefficients are float32. Each operator A has A 1 = tau, so it is applied as

    (A x)_p = tau_p x_p + sum_q A_pq (x_q - x_p),

which holds to rounding of the differences, however small tau is beside the coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from refine.solvers.linear import Problem, SolverError
from refine.system import Form
from refine.weights import NEIGHBORS, Floats

MARGIN = 2
Singles = NDArray[np.float32]
Grid = NDArray[np.floating[Any]]

HALF = ((0, 1), (0, 2), *((dy, dx) for dy in (1, 2) for dx in range(-2, 3)))
"""One of each pair of opposite offsets in the 5x5 window: the planes of a symmetric 25-point operator."""
_HALF = np.array(HALF)
_AROUND = np.array(NEIGHBORS)


@dataclass(frozen=True)
class Couplings:
    """What the image, the confidence and the gradient say of a refinement, before either form is made of it.

    All planes padded by `MARGIN`.
    """

    tau: Singles
    """(H, W) weight of the data term."""
    weights: Singles
    """(8, H, W) w_pq towards each of `NEIGHBORS`."""
    axial: Singles
    """(2, H, W) weight of the gradient term to the right and downwards: alpha phi, 0 where there is no
    term."""
    color: Singles
    """(H, W) beta (2 - phi_x - phi_y)."""
    right_hand_side: Floats
    """(H, W) b."""


@dataclass(frozen=True)
class StencilOperator:
    """One form's A."""

    tau: Singles
    planes: Singles
    """Exact form: (12, H, W), A[p, p + o] for o in `HALF`. Paper's: (8, H, W), A[p, p + o] for o in
    `NEIGHBORS`."""

    @property
    def symmetric(self) -> bool:
        return self.planes.shape[0] == len(HALF)

    def apply(self, x: Grid, out: Grid) -> None:
        """A x into `out`; both padded, in float32 or float64."""
        (_apply_symmetric if self.symmetric else _apply_one_sided)(self.planes, self.tau, x, out)

    def inverse_diagonal(self) -> Singles:
        """1 / A_pp, 0 on the border.

        Raises:
            refine.SolverError: If some A_pp is 0: nothing determines that pixel.
        """
        inverse = np.zeros_like(self.tau)
        (_invert_symmetric if self.symmetric else _invert_one_sided)(self.planes, self.tau, inverse)
        if not crop(inverse).all():
            height, width = crop(inverse).shape
            raise SolverError(
                f"the MRF of {width}x{height} pixels is singular: "
                "some pixel has neither a disparity nor a tie to its surroundings"
            )
        return inverse


def pad(values: NDArray[Any], dtype: type = np.float32) -> NDArray[Any]:
    """An image or a stack of images with a border of zeros."""
    padded: NDArray[Any] = np.zeros(
        (*values.shape[:-2], values.shape[-2] + 2 * MARGIN, values.shape[-1] + 2 * MARGIN), dtype
    )
    crop(padded)[...] = values
    return padded


def crop(padded: Grid) -> Grid:
    """The image inside the border, as a view."""
    return padded[..., MARGIN:-MARGIN, MARGIN:-MARGIN]


def couplings_of(problem: Problem) -> Couplings:
    """Read the couplings off a refinement's inputs."""
    parameters = problem.parameters
    height, width = problem.shape
    shape = (height + 2 * MARGIN, width + 2 * MARGIN)
    made = Couplings(
        tau=pad(np.maximum(problem.confidence, parameters.confidence_floor)),
        weights=np.zeros((len(NEIGHBORS), *shape), np.float32),
        axial=np.zeros((2, *shape), np.float32),
        color=np.zeros(shape, np.float32),
        right_hand_side=np.zeros(shape),
    )
    _weigh(
        np.ascontiguousarray(problem.image),
        parameters.alpha,
        parameters.beta,
        0.5 / parameters.sigma_r**2,
        made.weights,
        made.axial,
        made.color,
    )
    _gather_right_hand_side(
        np.ascontiguousarray(problem.disparity, np.float32),
        np.ascontiguousarray(problem.gradient, np.float32),
        made.tau,
        made.axial,
        made.right_hand_side,
    )
    return made


def operator_of(parts: Couplings, form: Form) -> StencilOperator:
    """N + beta L' Phibar L, 25 points and symmetric, or the paper's N + beta Phibar L, 9 points."""
    exact = form == "exact"
    planes = np.zeros((len(HALF) if exact else len(NEIGHBORS), *parts.tau.shape), np.float32)
    (_square if exact else _point)(parts.weights, parts.color, parts.axial, planes)
    return StencilOperator(parts.tau, planes)


@njit(cache=True, parallel=True, fastmath=True, error_model="numpy")
def _weigh(image, alpha, beta, falloff, weights, axial, color):
    """`refine.weights.edge_weights` and `neighbor_weights`, alpha and beta put in."""
    height, width = image.shape[:2]
    least = np.float32(-1 / math.log(0.01))
    for y in prange(height):
        squared = np.empty(8, np.float32)
        for x in range(width):
            right, below = min(x + 1, width - 1), min(y + 1, height - 1)
            across = downwards = 0
            for channel in range(3):
                here = np.int32(image[y, x, channel])
                across += (np.int32(image[y, right, channel]) - here) ** 2
                downwards += (np.int32(image[below, x, channel]) - here) ** 2
            phi_x, phi_y = math.exp(-falloff * across), math.exp(-falloff * downwards)
            color[y + 2, x + 2] = beta * (2 - phi_x - phi_y)
            if x + 1 < width:
                axial[0, y + 2, x + 2] = alpha * phi_x
            if y + 1 < height:
                axial[1, y + 2, x + 2] = alpha * phi_y
            # Grey values as sums of three channels: integers up to 765, differences exact.
            grey = np.int32(image[y, x, 0]) + np.int32(image[y, x, 1]) + np.int32(image[y, x, 2])
            count, total, total_squared, nearest = 1, 0, 0, 765 * 765
            for k in range(8):
                v, u = y + _AROUND[k, 0], x + _AROUND[k, 1]
                squared[k] = -1
                if 0 <= v < height and 0 <= u < width:
                    difference = (
                        np.int32(image[v, u, 0]) + np.int32(image[v, u, 1]) + np.int32(image[v, u, 2]) - grey
                    )
                    count += 1
                    total += difference
                    total_squared += difference * difference
                    nearest = min(nearest, difference * difference)
                    squared[k] = difference * difference
            variance = np.float32((count * total_squared - total * total) / (count * count))
            scale = max(np.float32(0.6) * variance, least * nearest, np.float32(2e-6 * 765 * 765))
            sharpness = -1 / scale
            normaliser = np.float32(0)
            for k in range(8):
                if squared[k] >= 0:
                    squared[k] = math.exp(squared[k] * sharpness)
                    normaliser += squared[k]
            for k in range(8):
                if squared[k] > 0:
                    weights[k, y + 2, x + 2] = squared[k] / normaliser


@njit(cache=True, parallel=True)
def _gather_right_hand_side(disparity, gradient, tau, axial, right_hand_side):
    """b = T D + C' (alpha Phi) G; also drops the gradient terms whose G is not finite from `axial`."""
    height, width = disparity.shape
    for y in prange(height):
        for x in range(width):
            for channel in range(2):
                if not np.isfinite(gradient[y, x, channel]):
                    axial[channel, y + 2, x + 2] = 0
    for y in prange(height):
        for x in range(width):
            value = tau[y + 2, x + 2] * np.float64(disparity[y, x])
            for channel in range(2):
                back_y, back_x = channel, 1 - channel
                weight = axial[channel, y + 2, x + 2]
                if weight > 0:
                    value -= weight * np.float64(gradient[y, x, channel])
                weight = axial[channel, y + 2 - back_y, x + 2 - back_x]
                if weight > 0:
                    value += weight * np.float64(gradient[y - back_y, x - back_x, channel])
            right_hand_side[y + 2, x + 2] = value


@njit(cache=True, parallel=True, fastmath=True)
def _square(weights, color, axial, planes):
    """Off-diagonal planes of N + L' Phi L: sum over the centres s that see both p and p + o."""
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for y in prange(height):
        for k in range(12):
            dy, dx = _HALF[k, 0], _HALF[k, 1]
            row = planes[k, y + 2]
            for sy in range(max(-1, dy - 1), min(1, dy + 1) + 1):
                for sx in range(max(-1, dx - 1), min(1, dx + 1) + 1):
                    # Seen from s: p lies at -(sy, sx), p + o at (dy - sy, dx - sx).
                    near = _place(-sy, -sx)
                    far = _place(dy - sy, dx - sx)
                    strength = color[y + 2 + sy, 2 + sx :]
                    if near < 0:
                        other = weights[far, y + 2 + sy, 2 + sx :]
                        for x in range(width):
                            row[x + 2] -= strength[x] * other[x]
                    elif far < 0:
                        other = weights[near, y + 2 + sy, 2 + sx :]
                        for x in range(width):
                            row[x + 2] -= strength[x] * other[x]
                    else:
                        one, other = weights[near, y + 2 + sy, 2 + sx :], weights[far, y + 2 + sy, 2 + sx :]
                        for x in range(width):
                            row[x + 2] += strength[x] * one[x] * other[x]
        for x in range(width):
            planes[0, y + 2, x + 2] -= axial[0, y + 2, x + 2]
            planes[4, y + 2, x + 2] -= axial[1, y + 2, x + 2]


@njit(cache=True)
def _place(dy, dx):
    """Number of the offset among `NEIGHBORS`; -1 for the centre."""
    place = (dy + 1) * 3 + dx + 1
    if place == 4:
        return -1
    return place if place < 4 else place - 1


@njit(cache=True, parallel=True, fastmath=True)
def _point(weights, color, axial, planes):
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for y in prange(height):
        for x in range(width):
            for k in range(8):
                planes[k, y + 2, x + 2] = -color[y + 2, x + 2] * weights[k, y + 2, x + 2]
            planes[1, y + 2, x + 2] -= axial[1, y + 1, x + 2]
            planes[3, y + 2, x + 2] -= axial[0, y + 2, x + 1]
            planes[4, y + 2, x + 2] -= axial[0, y + 2, x + 2]
            planes[6, y + 2, x + 2] -= axial[1, y + 2, x + 2]


@njit(cache=True, fastmath={"contract"})
def _both(a, k, x, c, y, j, dy, dx):
    """What the two neighbours p + o and p - o give to (A x)_p."""
    ahead = a[k, y + 2, j + 2] * (x[y + 2 + dy, j + 2 + dx] - c)
    return ahead + a[k, y + 2 - dy, j + 2 - dx] * (x[y + 2 - dy, j + 2 - dx] - c)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _apply_symmetric(a, tau, x, out):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            c = x[y + 2, j + 2]
            s = tau[y + 2, j + 2] * c
            s += _both(a, 0, x, c, y, j, 0, 1) + _both(a, 1, x, c, y, j, 0, 2)
            s += _both(a, 2, x, c, y, j, 1, -2) + _both(a, 3, x, c, y, j, 1, -1)
            s += _both(a, 4, x, c, y, j, 1, 0) + _both(a, 5, x, c, y, j, 1, 1)
            s += _both(a, 6, x, c, y, j, 1, 2) + _both(a, 7, x, c, y, j, 2, -2)
            s += _both(a, 8, x, c, y, j, 2, -1) + _both(a, 9, x, c, y, j, 2, 0)
            s += _both(a, 10, x, c, y, j, 2, 1) + _both(a, 11, x, c, y, j, 2, 2)
            out[y + 2, j + 2] = s


@njit(cache=True, parallel=True, fastmath={"contract"})
def _apply_one_sided(a, tau, x, out):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            c = x[y + 2, j + 2]
            s = tau[y + 2, j + 2] * c
            s += a[0, y + 2, j + 2] * (x[y + 1, j + 1] - c) + a[1, y + 2, j + 2] * (x[y + 1, j + 2] - c)
            s += a[2, y + 2, j + 2] * (x[y + 1, j + 3] - c) + a[3, y + 2, j + 2] * (x[y + 2, j + 1] - c)
            s += a[4, y + 2, j + 2] * (x[y + 2, j + 3] - c) + a[5, y + 2, j + 2] * (x[y + 3, j + 1] - c)
            s += a[6, y + 2, j + 2] * (x[y + 3, j + 2] - c) + a[7, y + 2, j + 2] * (x[y + 3, j + 3] - c)
            out[y + 2, j + 2] = s


@njit(cache=True, parallel=True)
def _invert_symmetric(a, tau, inverse):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            diagonal = tau[y + 2, j + 2]
            for k in range(12):
                diagonal -= a[k, y + 2, j + 2] + a[k, y + 2 - _HALF[k, 0], j + 2 - _HALF[k, 1]]
            inverse[y + 2, j + 2] = 1 / diagonal if diagonal > 0 else 0


@njit(cache=True, parallel=True)
def _invert_one_sided(a, tau, inverse):
    height, width = tau.shape[0] - 4, tau.shape[1] - 4
    for y in prange(height):
        for j in range(width):
            diagonal = tau[y + 2, j + 2]
            for k in range(8):
                diagonal -= a[k, y + 2, j + 2]
            inverse[y + 2, j + 2] = 1 / diagonal if diagonal > 0 else 0

"""The MRF's operators as stencils on the image grid: built, and applied, without a sparse matrix.

Every plane and every vector has a border of `MARGIN` zeros, so that no kernel asks where the image ends.
Coefficients are float32. Each operator A has A 1 = tau, so it is applied as

    (A x)_p = tau_p x_p + sum_q A_pq (x_q - x_p),

which holds to rounding of the differences, however small tau is beside the coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from refine.energy.affinity import NEIGHBORS, Floats
from refine.energy.system import Form
from refine.solvers.bfloat16 import Halves, widened
from refine.solvers.linear import Problem, SolverError

MARGIN = 2
Singles = NDArray[np.float32]
Grid = NDArray[np.floating[Any]]

HALF = ((0, 1), (0, 2), *((dy, dx) for dy in (1, 2) for dx in range(-2, 3)))
"""One of each pair of opposite offsets in the 5x5 window: the planes of a symmetric 25-point operator."""
_HALF = np.array(HALF)
_AROUND = np.array(NEIGHBORS)
_BAND = 64


@dataclass(frozen=True)
class Couplings:
    """What the image, the confidence and the gradient say of some rows of a refinement, before either form is made
    of it.

    All planes padded by `MARGIN`: at the sides by zeros, above and below by the rows there, or zeros at the
    image's own border.
    """

    tau: Singles
    """(H, W) weight of the data term."""
    weights: Singles
    """(8, H, W) w_pq towards each of `NEIGHBORS`."""
    axial: Singles
    """(2, H, W) weight of the gradient term to the right and downwards: alpha phi, times `Problem.gradient_factor`, 0
    where there is no term."""
    color: Singles
    """(H, W) beta (2 - phi_x - phi_y)."""

    def rows(self, first: int, last: int) -> Couplings:
        """Those of some rows of the image, of couplings of all."""
        some = slice(first, last + 2 * MARGIN)
        return Couplings(self.tau[some], self.weights[:, some], self.axial[:, some], self.color[some])

    def positive(self) -> Couplings:
        """These, 0 where they are negative."""
        weights, axial, color = (np.maximum(part, 0) for part in (self.weights, self.axial, self.color))
        return Couplings(self.tau, weights, axial, color)


CouplingRows = Callable[[int, int], Couplings]
"""First row and the one after the last, to the couplings of these rows."""


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
        _apply(self.planes, self.tau, x, out)

    def apply_against(self, x: Singles, other: Grid, out: Singles) -> tuple[float, float]:
        """A x into `out`, and its products with another vector and with itself."""
        return _apply_against(self.planes, self.tau, x, other, out)

    def remainder(self, b: Grid, x: Grid, out: Grid) -> float:
        """b - A x into `out`, worked out in the precision of `x`; its squared norm."""
        return _remainder(self.planes, self.tau, b, x, out)

    def smooth(self, b: Singles, step: Halves, x: Singles, out: Singles) -> None:
        """x + step (b - A x) into `out`."""
        _smooth(self.planes, self.tau, b, step, x, out)

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


@dataclass(frozen=True)
class System:
    """A x = b, seen from where the iterations begin."""

    operator: StencilOperator
    residual: Floats
    """(H, W) b - A x, padded. In float64: across a step of a disparity it is thousands of times what the floor of the
    confidence holds a pixel by."""
    size: float
    """|b|."""


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


def bands(height: int) -> Iterator[tuple[int, int]]:
    """The image a few rows at a time: what is made of its couplings needs them only while it is made."""
    for first in range(0, height, _BAND):
        yield first, min(first + _BAND, height)


def data_weight(problem: Problem) -> Singles:
    """tau, padded."""
    return pad(np.maximum(problem.confidence, problem.parameters.confidence_floor))


def couplings_of(problem: Problem, tau: Singles, first: int = 0, last: int | None = None) -> Couplings:
    """Read the couplings of these rows off a refinement's inputs and its `data_weight`; of all by default."""
    parameters = problem.parameters
    last = problem.shape[0] if last is None else last
    tau = tau[first : last + 2 * MARGIN]
    made = Couplings(
        tau=tau,
        weights=np.zeros((len(NEIGHBORS), *tau.shape), np.float32),
        axial=np.zeros((2, *tau.shape), np.float32),
        color=np.zeros_like(tau),
    )
    phi = np.exp(np.arange(_differences_until(parameters.sigma_r)) * (-0.5 / parameters.sigma_r**2))
    phi[-1] = 0
    _weigh(
        problem.image,
        problem.gradient,
        first,
        (parameters.alpha * phi).astype(np.float32),
        (parameters.beta * (1 - phi)).astype(np.float32),
        made.weights,
        made.axial,
        made.color,
    )
    if problem.gradient_factor is not None:
        top, bottom = max(first - MARGIN, 0), min(last + MARGIN, problem.shape[0])
        here = made.axial[:, top - first + MARGIN : bottom - first + MARGIN, MARGIN:-MARGIN]
        here *= np.moveaxis(problem.gradient_factor[top:bottom], 2, 0)
    return made


def _differences_until(sigma_r: float) -> int:
    """Up to this squared colour difference phi is more than nothing in float32."""
    return min(int(210 * sigma_r**2), 3 * 255**2) + 2


def operator_of(tau: Singles, couplings: CouplingRows, form: Form) -> StencilOperator:
    """A, for a padded tau; each row's couplings are asked for once, in order."""
    exact = form == "exact"
    planes = np.zeros((len(HALF) if exact else len(NEIGHBORS), *tau.shape), np.float32)
    for first, last in bands(tau.shape[0] - 2 * MARGIN):
        parts = couplings(first, last)
        (_square if exact else _point)(parts.weights, parts.color, parts.axial, first, planes)
    return StencilOperator(tau, planes)


def system_of(problem: Problem, tau: Singles) -> System:
    """The system of a refinement: A is N + beta L' Phibar L, 25 points and symmetric, or the paper's N + beta Phibar
    L, 9 points."""
    b = np.zeros(tau.shape)

    def couplings(first: int, last: int) -> Couplings:
        parts = couplings_of(problem, tau, first, last)
        # Here, because they are not kept.
        _gather_right_hand_side(problem.disparity, problem.gradient, parts.tau, parts.axial, first, b)
        return parts

    operator = operator_of(tau, couplings, problem.form)
    size = float(np.linalg.norm(b))
    operator.remainder(b, pad(problem.start, np.float64), b)
    return System(operator, b, size)


@njit(cache=True, fastmath={"contract"})
def _exponential(t):
    """exp of a float32 that is not positive, in operations that vectorise; 0 below -87."""
    turns = np.floor(t * np.float32(1.44269504) + np.float32(0.5))
    f = t - turns * np.float32(0.693359375) + turns * np.float32(2.12194440e-4)
    series = np.float32(1 / 120) + f * np.float32(1 / 720)
    series = np.float32(1 / 6) + f * (np.float32(1 / 24) + f * series)
    series = np.float32(1) + f * (np.float32(1) + f * (np.float32(0.5) + f * series))
    power = np.int32(np.int32(max(turns, np.float32(-126))) + np.int32(127))
    return series * np.int32(power << np.int32(23)).view(np.float32) if t > np.float32(-87) else np.float32(0)


@njit(cache=True, parallel=True, fastmath={"contract"})
def _weigh(image, gradient, first, axial_of, color_of, weights, axial, color):
    """`refine.energy.affinity.edge_weights` and `neighbor_weights`, alpha and beta put in, for the rows from `first`
    on, and two more above and below."""
    height, width = image.shape[:2]
    rows = color.shape[0]
    # Grey values as sums of three channels: integers up to 765, differences exact.
    grey = np.zeros((rows + 2, width), np.int32)
    for row in prange(rows + 2):
        y = np.int64(row) + first - 3
        if 0 <= y < height:
            for x in range(width):
                grey[row, x] = np.int32(image[y, x, 0]) + np.int32(image[y, x, 1]) + np.int32(image[y, x, 2])
    for row in prange(rows):
        y = np.int64(row) + first - 2
        if 0 <= y < height:
            _weigh_edges(image, gradient, y, axial_of, color_of, axial[:, row], color[row])
            _weigh_neighbors(grey, row, y, height, weights)


@njit(cache=True)
def _weigh_edges(image, gradient, y, axial_of, color_of, axial, color):
    height, width = image.shape[:2]
    below = min(y + 1, height - 1)
    last = axial_of.size - 1
    for x in range(width):
        right = min(x + 1, width - 1)
        across = downwards = 0
        for channel in range(3):
            here = np.int32(image[y, x, channel])
            across += (np.int32(image[y, right, channel]) - here) ** 2
            downwards += (np.int32(image[below, x, channel]) - here) ** 2
        across, downwards = min(across, last), min(downwards, last)
        color[x + 2] = color_of[across] + color_of[downwards]
        if x + 1 < width and np.isfinite(gradient[y, x, 0]):
            axial[0, x + 2] = axial_of[across]
        if y + 1 < height and np.isfinite(gradient[y, x, 1]):
            axial[1, x + 2] = axial_of[downwards]


@njit(cache=True, fastmath={"contract"})
def _weigh_neighbors(grey, row, y, height, weights):
    width = grey.shape[1]
    least = np.float32(-1 / math.log(0.01))
    squared = np.full((8, width), np.float32(1e30), np.float32)
    total, total_squared = np.zeros(width, np.int32), np.zeros(width, np.int32)
    nearest = np.full(width, np.float32(765 * 765), np.float32)
    for k in range(8):
        dy, dx = _AROUND[k, 0], _AROUND[k, 1]
        if 0 <= y + dy < height:
            begin, end = max(0, -dx), width - max(0, dx)
            here, there = grey[row + 1, begin:end], grey[row + 1 + dy, begin + dx : end + dx]
            squares, sums, sums_squared = squared[k, begin:end], total[begin:end], total_squared[begin:end]
            smallest = nearest[begin:end]
            for x in range(here.size):
                difference = there[x] - here[x]
                sums[x] += difference
                sums_squared[x] += difference * difference
                squares[x] = difference * difference
                smallest[x] = min(smallest[x], squares[x])
    tall = 1 + (y > 0) + (y + 1 < height)
    sharpness, normaliser = np.empty(width, np.float32), np.zeros(width, np.float32)
    for x in range(width):
        count = np.int32(tall * (1 + (x > 0) + (x + 1 < width)))
        spread = np.float32(count * total_squared[x] - total[x] * total[x])
        variance = spread / np.float32(count * count)
        scale = max(np.float32(0.6) * variance, least * nearest[x], np.float32(2e-6 * 765 * 765))
        sharpness[x] = np.float32(-1) / scale
    for k in range(8):
        squares = squared[k]
        for x in range(width):
            squares[x] = _exponential(squares[x] * sharpness[x])
            normaliser[x] += squares[x]
    for x in range(width):
        normaliser[x] = np.float32(1) / normaliser[x] if normaliser[x] > 0 else np.float32(0)
    for k in range(8):
        out, squares = weights[k, row], squared[k]
        for x in range(width):
            out[x + 2] = squares[x] * normaliser[x]


@njit(cache=True, parallel=True)
def _gather_right_hand_side(disparity, gradient, tau, axial, first, right_hand_side):
    """b = T D + C' (alpha Phi) G, of some rows."""
    width = disparity.shape[1]
    for row in prange(tau.shape[0] - 4):
        y = np.int64(row) + first
        for x in range(width):
            value = tau[row + 2, x + 2] * np.float64(disparity[y, x])
            for channel in range(2):
                back_y, back_x = channel, 1 - channel
                weight = axial[channel, row + 2, x + 2]
                if weight > 0:
                    value -= weight * np.float64(gradient[y, x, channel])
                weight = axial[channel, row + 2 - back_y, x + 2 - back_x]
                if weight > 0:
                    value += weight * np.float64(gradient[y - back_y, x - back_x, channel])
            right_hand_side[y + 2, x + 2] = value


@njit(cache=True, parallel=True, fastmath=True)
def _square(weights, color, axial, first, planes):
    """Off-diagonal planes of N + L' Phi L, of some rows: sum over the centres s that see both p and p + o."""
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for y in prange(height):
        for k in range(12):
            dy, dx = _HALF[k, 0], _HALF[k, 1]
            row = planes[k, first + y + 2]
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
            planes[0, first + y + 2, x + 2] -= axial[0, y + 2, x + 2]
            planes[4, first + y + 2, x + 2] -= axial[1, y + 2, x + 2]


@njit(cache=True)
def _place(dy, dx):
    """Number of the offset among `NEIGHBORS`; -1 for the centre."""
    place = (dy + 1) * 3 + dx + 1
    if place == 4:
        return -1
    return place if place < 4 else place - 1


@njit(cache=True, parallel=True, fastmath=True)
def _point(weights, color, axial, first, planes):
    height, width = color.shape[0] - 4, color.shape[1] - 4
    for y in prange(height):
        for x in range(width):
            for k in range(8):
                planes[k, first + y + 2, x + 2] = -color[y + 2, x + 2] * weights[k, y + 2, x + 2]
            planes[1, first + y + 2, x + 2] -= axial[1, y + 1, x + 2]
            planes[3, first + y + 2, x + 2] -= axial[0, y + 2, x + 1]
            planes[4, first + y + 2, x + 2] -= axial[0, y + 2, x + 2]
            planes[6, first + y + 2, x + 2] -= axial[1, y + 2, x + 2]


@njit(cache=True, fastmath={"contract"})
def _row(a, tau, x, y, out):
    """Row y of A x into a padded row. A plane at a time: a sum over all planes in one loop takes numba ten times as
    long to compile, and runs no faster, since the planes' way from memory is what takes the time."""
    here, own = x[y + 2], tau[y + 2]
    for j in range(2, here.size - 2):
        out[j] = own[j] * here[j]
    if a.shape[0] == 12:
        for k in range(12):
            dy, dx = _HALF[k, 0], _HALF[k, 1]
            _add(a[k, y + 2], 0, x[y + 2 + dy], dx, here, out)
            _add(a[k, y + 2 - dy], -dx, x[y + 2 - dy], -dx, here, out)
    else:
        for k in range(8):
            dy, dx = _AROUND[k, 0], _AROUND[k, 1]
            _add(a[k, y + 2], 0, x[y + 2 + dy], dx, here, out)


@njit(cache=True, fastmath={"contract"})
def _add(plane, at, row, dx, here, out):
    """What the neighbours by dx in a row give to (A x)_p, with the coefficients that stand `at` beside p."""
    for j in range(2, here.size - 2):
        out[j] += plane[j + at] * (row[j + dx] - here[j])


@njit(cache=True, parallel=True)
def _apply(a, tau, x, out):
    for y in prange(tau.shape[0] - 4):
        _row(a, tau, x, y, out[y + 2])


@njit(cache=True, parallel=True, fastmath={"contract", "reassoc"})
def _apply_against(a, tau, x, other, out):
    product = norm = 0.0
    for y in prange(tau.shape[0] - 4):
        row, against = out[y + 2], other[y + 2]
        _row(a, tau, x, y, row)
        row_product = row_norm = 0.0
        for j in range(row.size):
            row_product += np.float64(row[j]) * np.float64(against[j])
            row_norm += np.float64(row[j]) * np.float64(row[j])
        product += row_product
        norm += row_norm
    return product, norm


@njit(cache=True, parallel=True, fastmath={"contract", "reassoc"})
def _remainder(a, tau, b, x, out):
    norm = 0.0
    for y in prange(tau.shape[0] - 4):
        product = np.zeros(tau.shape[1], x.dtype)
        _row(a, tau, x, y, product)
        row, aim = out[y + 2], b[y + 2]
        row_norm = 0.0
        for j in range(row.size):
            row[j] = aim[j] - product[j]
            row_norm += np.float64(row[j]) * np.float64(row[j])
        norm += row_norm
    return norm


@njit(cache=True, parallel=True, fastmath={"contract"})
def _smooth(a, tau, b, step, x, out):
    for y in prange(tau.shape[0] - 4):
        row = out[y + 2]
        _row(a, tau, x, y, row)
        here, aim, steps = x[y + 2], b[y + 2], step[y + 2]
        for j in range(row.size):
            row[j] = here[j] + widened(steps[j]) * (aim[j] - row[j])


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

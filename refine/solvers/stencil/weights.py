"""The weights of the energy's terms, read off the image in float32: what both forms of A are assembled from.

The same as `refine.energy.affinity.edge_weights` and `neighbor_weights`, with alpha and beta multiplied in, made for a
band of rows at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from refine.energy.affinity import NEIGHBORS
from refine.solvers.arrays import Float32Array
from refine.solvers.linear import Problem
from refine.solvers.stencil.padding import MARGIN, pad
from stereoforge_kit.kernels import njit, prange

_NEIGHBORS = np.array(NEIGHBORS)


@dataclass(frozen=True)
class StencilWeights:
    """Weights of the energy's terms for a band of rows, before either form of A is assembled from them.

    All planes are padded by `MARGIN`: with zeros at the sides, with the adjacent rows above and below, or zeros
    where the image ends.
    """

    tau: Float32Array
    """(H, W) weight of the data term."""
    neighbors: Float32Array
    """(8, H, W) w_pq towards each of `refine.energy.affinity.NEIGHBORS`."""
    gradient: Float32Array
    """(2, H, W) weight of the gradient term to the right and downwards: alpha phi, times
    `Problem.gradient_factor`, 0 where there is no term."""
    color: Float32Array
    """(H, W) weight of the colour term, beta (2 - phi_x - phi_y)."""

    def band(self, first: int, last: int) -> StencilWeights:
        """The rows from `first` up to `last` (exclusive) of the whole image's weights, as views."""
        rows = slice(first, last + 2 * MARGIN)
        return StencilWeights(
            self.tau[rows], self.neighbors[:, rows], self.gradient[:, rows], self.color[rows]
        )

    def clamped(self) -> StencilWeights:
        """The same weights with the negative ones, tau apart, set to 0."""
        neighbors, gradient, color = (np.maximum(w, 0) for w in (self.neighbors, self.gradient, self.color))
        return StencilWeights(self.tau, neighbors, gradient, color)


BandWeights = Callable[[int, int], StencilWeights]
"""(first row, row after the last) -> the weights of that band."""


def data_weight(problem: Problem) -> Float32Array:
    """tau, the confidence but at least its floor: (H, W), padded."""
    return pad(np.maximum(problem.confidence, problem.parameters.confidence_floor))


def stencil_weights(
    problem: Problem, tau: Float32Array, first: int = 0, last: int | None = None
) -> StencilWeights:
    """Compute the weights of a refinement's energy.

    Args:
        problem: The refinement.
        tau: Its `data_weight`.
        first: First row.
        last: The row after the last one; the image's height if None.

    Returns:
        The weights of these rows.
    """
    last = problem.shape[0] if last is None else last
    tau = tau[first : last + 2 * MARGIN]
    weights = StencilWeights(
        tau=tau,
        neighbors=np.zeros((len(NEIGHBORS), *tau.shape), np.float32),
        gradient=np.zeros((2, *tau.shape), np.float32),
        color=np.zeros_like(tau),
    )
    gradient_table, color_table = _weight_tables(problem)
    _compute_weights(
        problem.image,
        problem.gradient,
        first,
        gradient_table,
        color_table,
        weights.neighbors,
        weights.gradient,
        weights.color,
    )
    if problem.gradient_factor is not None:
        top, bottom = max(first - MARGIN, 0), min(last + MARGIN, problem.shape[0])
        inside = weights.gradient[:, top - first + MARGIN : bottom - first + MARGIN, MARGIN:-MARGIN]
        inside *= np.moveaxis(problem.gradient_factor[top:bottom], 2, 0)
    return weights


def _weight_tables(problem: Problem) -> tuple[Float32Array, Float32Array]:
    """alpha phi and beta (1 - phi) for every squared colour difference, an integer; the last stands for all larger
    ones."""
    alpha, beta, sigma_r = problem.parameters.alpha, problem.parameters.beta, problem.parameters.sigma_r
    # From 210 sigma_r^2 on phi is nothing in float32.
    size = min(int(210 * sigma_r**2), 3 * 255**2) + 2
    phi = np.exp(np.arange(size) * (-0.5 / sigma_r**2))
    phi[-1] = 0
    return (alpha * phi).astype(np.float32), (beta * (1 - phi)).astype(np.float32)


@njit(fastmath={"contract"})
def _exp(t):
    """exp of a float32 that is not positive, in operations that vectorise; 0 below -87."""
    exponent = np.floor(t * np.float32(1.44269504) + np.float32(0.5))
    f = t - exponent * np.float32(0.693359375) + exponent * np.float32(2.12194440e-4)
    series = np.float32(1 / 120) + f * np.float32(1 / 720)
    series = np.float32(1 / 6) + f * (np.float32(1 / 24) + f * series)
    series = np.float32(1) + f * (np.float32(1) + f * (np.float32(0.5) + f * series))
    power = np.int32(np.int32(max(exponent, np.float32(-126))) + np.int32(127))
    return series * np.int32(power << np.int32(23)).view(np.float32) if t > np.float32(-87) else np.float32(0)


@njit(parallel=True, fastmath={"contract"})
def _compute_weights(
    image, gradient, first, gradient_table, color_table, neighbor_weight, gradient_weight, color_weight
):
    """Fill the weights of a band that begins at row `first`, its margins of two rows included."""
    height, width = image.shape[:2]
    rows = color_weight.shape[0]
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
            _edge_weights(
                image, gradient, y, gradient_table, color_table, gradient_weight[:, row], color_weight[row]
            )
            _neighbor_weights(grey, row, y, height, neighbor_weight)


@njit()
def _edge_weights(image, gradient, y, gradient_table, color_table, gradient_weight, color_weight):
    """Image row y of alpha phi_x, alpha phi_y and beta (2 - phi_x - phi_y)."""
    height, width = image.shape[:2]
    below = min(y + 1, height - 1)
    last = gradient_table.size - 1
    for x in range(width):
        right = min(x + 1, width - 1)
        squared_x = squared_y = 0
        for channel in range(3):
            here = np.int32(image[y, x, channel])
            squared_x += (np.int32(image[y, right, channel]) - here) ** 2
            squared_y += (np.int32(image[below, x, channel]) - here) ** 2
        squared_x, squared_y = min(squared_x, last), min(squared_y, last)
        color_weight[x + 2] = color_table[squared_x] + color_table[squared_y]
        if x + 1 < width and np.isfinite(gradient[y, x, 0]):
            gradient_weight[0, x + 2] = gradient_table[squared_x]
        if y + 1 < height and np.isfinite(gradient[y, x, 1]):
            gradient_weight[1, x + 2] = gradient_table[squared_y]


@njit(fastmath={"contract"})
def _neighbor_weights(grey, row, y, height, weights):
    """Row `row` of w_pq, which is image row y."""
    width = grey.shape[1]
    squared = np.full((8, width), np.float32(1e30), np.float32)  # no neighbour: a weight of 0
    falloff = np.empty(width, np.float32)
    _window_statistics(grey, row, y, height, squared, falloff)
    normaliser = np.zeros(width, np.float32)
    for k in range(8):
        plane = squared[k]
        for x in range(width):
            plane[x] = _exp(plane[x] * falloff[x])
            normaliser[x] += plane[x]
    for x in range(width):
        normaliser[x] = np.float32(1) / normaliser[x] if normaliser[x] > 0 else np.float32(0)
    for k in range(8):
        out, plane = weights[k, row], squared[k]
        for x in range(width):
            out[x + 2] = plane[x] * normaliser[x]


@njit(fastmath={"contract"})
def _window_statistics(grey, row, y, height, squared, falloff):
    """(g_q - g_p)^2 for the eight neighbours q, and -1 / c_p, in units of summed channels."""
    width = grey.shape[1]
    total, total_squared = np.zeros(width, np.int32), np.zeros(width, np.int32)
    nearest = np.full(width, np.float32(765 * 765), np.float32)
    for k in range(8):
        dy, dx = _NEIGHBORS[k, 0], _NEIGHBORS[k, 1]
        if 0 <= y + dy < height:
            begin, end = max(0, -dx), width - max(0, dx)
            here, there = grey[row + 1, begin:end], grey[row + 1 + dy, begin + dx : end + dx]
            plane, sums, sums_squared = squared[k, begin:end], total[begin:end], total_squared[begin:end]
            smallest = nearest[begin:end]
            for x in range(here.size):
                difference = there[x] - here[x]
                sums[x] += difference
                sums_squared[x] += difference * difference
                plane[x] = difference * difference
                smallest[x] = min(smallest[x], plane[x])
    window_height = 1 + (y > 0) + (y + 1 < height)
    least = np.float32(-1 / math.log(0.01))
    for x in range(width):
        count = np.int32(window_height * (1 + (x > 0) + (x + 1 < width)))
        spread = np.float32(count * total_squared[x] - total[x] * total[x])
        variance = spread / np.float32(count * count)
        scale = max(np.float32(0.6) * variance, least * nearest[x], np.float32(2e-6 * 765 * 765))
        falloff[x] = np.float32(-1) / scale

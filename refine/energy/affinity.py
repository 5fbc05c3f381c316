"""Affinities between neighbouring pixels, computed from the image: the energy's phi and w."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

NEIGHBORS = tuple((dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0))
"""The eight neighbours of a pixel as (rows down, columns right), in reading order."""

Floats = NDArray[np.float64]


def edge_weights(image: NDArray[np.uint8], sigma_r: float) -> tuple[Floats, Floats]:
    """Weights phi of the gradient term: close to 1 in smooth areas, close to 0 across image edges.

    phi_x = exp(-|I(y, x + 1) - I(y, x)|^2 / (2 sigma_r^2)), the norm taken over the three channels in 0..255
    units; phi_y alike, downwards (paper, Eq. 6). In the last column (row) the difference is 0, so phi_x
    (phi_y) is 1: the border is replicated.

    Args:
        image: (H, W, 3) uint8.
        sigma_r: In 8-bit units.

    Returns:
        phi_x and phi_y, (H, W) each.
    """
    values = image.astype(np.float64)
    phi = []
    for axis in (1, 0):
        last = np.take(values, [-1], axis=axis)
        squared = np.square(np.diff(values, axis=axis, append=last)).sum(axis=2)
        phi.append(np.exp(-squared / (2 * sigma_r**2)))
    return phi[0], phi[1]


def neighbor_weights(image: NDArray[np.uint8]) -> Floats:
    """Weights w_pq of the colour term: the similarity of a pixel to its eight neighbours, which sums to 1.

    With g the mean of red, green and blue over 255, v_p its population variance in the 3x3 window around p
    (the part of it inside the image) and m_p the smallest (g_p - g_q)^2 of the neighbours:

        w_pq ~ exp(-(g_p - g_q)^2 / c_p),   c_p = max(0.6 v_p, -m_p / ln 0.01, 2e-6)

    The paper prints exp(-|I_p - I_q|^2 / (2 sigma_p^2)) and builds on the published code of Levin, Lischinski
    and Weiss, "Colorization using Optimization" (SIGGRAPH 2004), whose constants these are. The second bound
    keeps the most similar neighbour's weight at 0.01 or more before normalisation, so no pixel is cut off.

    Args:
        image: (H, W, 3) uint8.

    Returns:
        (8, H, W), one plane for each of `NEIGHBORS`; 0 where that neighbour is outside the image. All 0 for
        the single pixel of a 1x1 image, which has no neighbour.
    """
    grey = image.astype(np.float64).mean(axis=2) / 255
    squared = np.full((len(NEIGHBORS), *grey.shape), np.inf)
    # The variance is taken about the centre's own value, so that flat areas give 0 and not rounding noise.
    count, total, total_squared = np.ones_like(grey), np.zeros_like(grey), np.zeros_like(grey)
    for plane, (here, there) in zip(squared, neighbor_slices(grey.shape), strict=True):
        difference = grey[there] - grey[here]
        plane[here] = difference**2
        count[here] += 1
        total[here] += difference
        total_squared[here] += difference**2
    variance = total_squared / count - (total / count) ** 2
    nearest = squared.min(axis=0)
    nearest[~np.isfinite(nearest)] = 0
    scale = np.maximum(np.maximum(0.6 * variance, -nearest / np.log(0.01)), 2e-6)
    weights: Floats = np.exp(-squared / scale)
    total_weight = weights.sum(axis=0)
    weights /= np.where(total_weight > 0, total_weight, 1)
    return weights


def neighbor_slices(
    shape: tuple[int, ...],
) -> Iterator[tuple[tuple[slice, slice], tuple[slice, slice]]]:
    """For each of `NEIGHBORS`: the pixels that have that neighbour, and the neighbours, as slices of an
    array."""
    height, width = shape
    for dy, dx in NEIGHBORS:
        here = (slice(max(0, -dy), height - max(0, dy)), slice(max(0, -dx), width - max(0, dx)))
        there = (slice(max(0, dy), height - max(0, -dy)), slice(max(0, dx), width - max(0, -dx)))
        yield here, there

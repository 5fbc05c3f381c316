"""Stems, boughs and clouds of leaves: the parts of plants."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, Vertices, tube
from scenes.geometry.leaves import arched, strips, width_directions

UP = np.array((0.0, 0.0, 1.0))


def normalized(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 3) vectors scaled to length 1."""
    scaled: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return scaled


def stem(path: Vertices, radius: NDArray[np.float64], sides: int = 7) -> Part:
    """A round stem along a path (N, 3) of given radii (N,)."""
    vertices, triangles, _ = tube(path, radius, sides)
    return vertices, triangles


def winding_path(
    rng: np.random.Generator, start: Vertices, end: Vertices, wobble: float, points: int
) -> Vertices:
    """A random path (points, 3) from `start` (3,) to `end` (3,) that strays from a line by about `wobble`."""
    share = np.linspace(0.0, 1.0, points)
    waves = np.zeros((points, 3))
    for k in range(3):
        waves += np.outer(np.sin(np.pi * share * (k + 0.5)), rng.normal(0.0, 1.0 / (k + 1), 3))
    path: Vertices = start + np.outer(share, end - start) + wobble * waves * (1.0, 1.0, 0.3)
    return path


def leaf_cloud(
    rng: np.random.Generator, centres: Vertices, radius: NDArray[np.float64], leaves: int, size: float
) -> Part:
    """Pointed leaves on balls, hanging outward: the crowns of bushes and trees.

    The balls have centres (N, 3) and radii (N,); there are `leaves` leaves in all, of about the length `size`.
    """
    owner = rng.integers(0, len(centres), leaves)
    outward = normalized(rng.normal(size=(leaves, 3)) + 0.25 * UP)
    base = centres[owner] + outward * (radius[owner] * rng.uniform(0.55, 1.0, leaves))[:, None]
    direction = normalized(outward + rng.normal(0.0, 0.5, (leaves, 3)) - 0.35 * UP)
    length = size * rng.uniform(0.7, 1.3, leaves)
    paths = arched(base, direction, length, rng.uniform(0.0, 0.3, leaves), 3)
    side = width_directions(direction, rng)
    tilt = normalized(side + rng.normal(0.0, 0.35, (leaves, 3)))
    return strips(paths, tilt, (0.34 * length)[:, None])

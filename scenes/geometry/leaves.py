"""Thin pointed strips in large numbers: blades of grass, leaves, leaflets. Each is a closed surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Triangles, Vertices


def strips(
    paths: NDArray[np.float64],
    side: NDArray[np.float64],
    half_width: NDArray[np.float64],
    thickness: float = 0.12,
) -> tuple[Vertices, Triangles]:
    """Strips with a lens-shaped section along curves, running to a point at either end.

    `paths` (N, K, 3), K at least 3, are the middle lines and `side` (N, 3) the directions of the widths.
    `half_width` (N, K - 2) are half the widths between the ends; `thickness` is relative to them. A strip has
    8 (K - 2) triangles.
    """
    count, stations = paths.shape[:2]
    middle = paths[:, 1:-1]
    tangent = paths[:, 2:] - paths[:, :-2]
    across = half_width[..., None] * side[:, None]
    normal = np.cross(across, tangent)
    normal *= thickness * half_width[..., None] / np.maximum(np.linalg.norm(normal, axis=2), 1e-12)[..., None]
    rings = np.stack([middle + across, middle + normal, middle - across, middle - normal], axis=2)
    vertices = np.concatenate([paths[:, :1], rings.reshape(count, -1, 3), paths[:, -1:]], axis=1)
    one = _strip_triangles(stations - 2)
    triangles = one[None] + (vertices.shape[1] * np.arange(count))[:, None, None]
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def _strip_triangles(rings: int) -> Triangles:
    """Triangles of a point, `rings` rings of four and a point, outward for the rings of `strips`."""
    i = np.arange(4)
    j = np.roll(i, -1)
    last = 4 * rings + 1
    parts = [np.stack([np.zeros(4, np.int64), i + 1, j + 1], -1)]
    for ring in range(rings - 1):
        a, b = 4 * ring + 1 + i, 4 * ring + 1 + j
        parts += [np.stack([a, b + 4, b], -1), np.stack([a, a + 4, b + 4], -1)]
    end = 4 * (rings - 1) + 1
    parts.append(np.stack([end + i, np.full(4, last), end + j], -1))
    return np.concatenate(parts).astype(np.int64)


def arched(
    base: NDArray[np.float64],
    direction: NDArray[np.float64],
    length: NDArray[np.float64],
    droop: NDArray[np.float64],
    stations: int,
) -> NDArray[np.float64]:
    """(N, stations, 3) curves that start at `base` (N, 3) along `direction` (N, 3) and bend down.

    `droop` (N,) is how far the tip falls below the straight line, relative to the length; the curve keeps
    its length only roughly.
    """
    share = np.linspace(0.0, 1.0, stations)
    straight = base[:, None] + (length[:, None] * share)[..., None] * direction[:, None]
    straight[..., 2] -= (droop * length)[:, None] * share**2
    return straight


def width_directions(direction: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """(N, 3) unit vectors across directions (N, 3), for a strip's width: level unless the direction is upright."""
    heading = rng.uniform(0.0, 2 * np.pi, len(direction))
    aside = np.stack([np.cos(heading), np.sin(heading), np.zeros(len(direction))], -1)
    level = np.cross(direction, (0.0, 0.0, 1.0))
    upright = np.linalg.norm(level, axis=1) < 0.2
    level[upright] = np.cross(direction[upright], aside[upright])
    unit: NDArray[np.float64] = level / np.linalg.norm(level, axis=1, keepdims=True)
    return unit


def around(
    rng: np.random.Generator, count: int, elevation_deg: tuple[float, float], start_deg: float = 0.0
) -> NDArray[np.float64]:
    """(count, 3) unit vectors spread evenly about the z axis, with jitter, at elevations in a range."""
    heading = np.radians(start_deg) + 2 * np.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    elevation = np.radians(rng.uniform(*elevation_deg, count))
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(heading), flat * np.sin(heading), np.sin(elevation)], -1)

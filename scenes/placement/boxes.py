"""Bounding boxes of things, and how far points are from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_SIGNS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_LATTICE = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 9)] * 3, indexing="ij"), -1).reshape(-1, 3)
_LATTICE = _LATTICE[np.abs(_LATTICE).max(axis=1) > 0.999]
"""Points all over the faces of the cube [-1, 1]^3."""


@dataclass(frozen=True)
class OrientedBox:
    """A box with axes of its own."""

    centre: NDArray[np.float64]
    """(3,)."""
    half: NDArray[np.float64]
    """(3,) half the sides, along the box's axes."""
    rotation: NDArray[np.float64]
    """(3, 3) from the box's axes to those of `centre`."""

    @property
    def corners(self) -> NDArray[np.float64]:
        """(8, 3)."""
        return self._points(_SIGNS)

    @property
    def surface_points(self) -> NDArray[np.float64]:
        """(386, 3) a lattice of points over all faces."""
        return self._points(_LATTICE)

    def _points(self, relative: NDArray[np.float64]) -> NDArray[np.float64]:
        points: NDArray[np.float64] = self.centre + (relative * self.half) @ self.rotation.T
        return points

    def distance(self, points: NDArray[np.float64]) -> float:
        """From the nearest of (N, 3) points to the box; 0 inside."""
        local = np.abs((points - self.centre) @ self.rotation)
        return float(np.linalg.norm(np.maximum(local - self.half, 0.0), axis=1).min())

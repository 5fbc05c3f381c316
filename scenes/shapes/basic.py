"""The plain solids: boxes, spheres, planes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.mesh import Mesh
from scenes.spec import Shape


@dataclass(frozen=True)
class Plane(Shape):
    """The square [-1, 1]^2 at z = 0, facing +z; texture coordinates are x and y."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls()

    def mesh(self) -> Mesh:
        vertices = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float64)
        triangles = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
        return Mesh(vertices, triangles, vertices[triangles][:, :, :2].astype(np.float32))

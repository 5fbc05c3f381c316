"""Basic solids: planes, boxes, ellipsoids, superquadrics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import (
    Triangles,
    Vertices,
    fit_to_cube,
    grid_triangles,
    icosphere,
    solid,
    weld,
)
from scenes.geometry.mesh import Mesh
from scenes.random_draws import log_uniform, uniform
from scenes.spec import Shape, Vector


def sample_proportions(rng: np.random.Generator, slimmest: float = 0.35) -> Vector:
    """Half extents along x, y, z: one of them 1, the others between `slimmest` and 1, in random order."""
    extents = rng.permutation([1.0, uniform(rng, slimmest, 1.0), uniform(rng, slimmest, 1.0)])
    return (float(extents[0]), float(extents[1]), float(extents[2]))


def cube_grid(cells: int) -> tuple[Vertices, Triangles]:
    """The surface of the cube [-1, 1]^3 with each face a grid of cells x cells squares."""
    line = np.linspace(-1.0, 1.0, cells + 1)
    a, b = np.meshgrid(line, line, indexing="ij")
    face = np.stack([a, b, np.ones_like(a)], -1).reshape(-1, 3)
    triangles = grid_triangles(cells + 1, cells + 1)
    sides: list[Vertices] = []
    faces: list[Triangles] = []
    for axis in range(3):
        turned = np.roll(face, axis, axis=1)
        for sign in (1.0, -1.0):
            faces.append((triangles if sign > 0 else triangles[:, ::-1]) + len(face) * len(sides))
            sides.append(turned * sign if sign > 0 else turned * np.roll([1.0, 1.0, -1.0], axis))
    vertices, welded, _ = weld(np.concatenate(sides), np.concatenate(faces))
    return vertices, welded


@dataclass(frozen=True)
class Plane(Shape):
    """The square [-1, 1]^2 at z = 0, facing +z; texture coordinates are x and y."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:  # noqa: ARG003
        return cls()

    def mesh(self) -> Mesh:
        vertices = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float64)
        triangles = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
        return Mesh(vertices, triangles, vertices[triangles][:, :, :2].astype(np.float32))


@dataclass(frozen=True)
class Box(Shape):
    """A cuboid, optionally a truncated pyramid."""

    half_extents: Vector
    """Relative half lengths along x, y and z."""
    taper: float = 1.0
    """Size of the top face relative to the bottom one."""

    popularity: ClassVar[float] = 2.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        taper = uniform(rng, 0.3, 1.0) if rng.random() < 0.25 else 1.0
        return cls(half_extents=sample_proportions(rng, 0.15), taper=taper)

    def mesh(self) -> Mesh:
        vertices, triangles = cube_grid(1)
        vertices[vertices[:, 2] > 0, :2] *= self.taper
        return solid(vertices * self.half_extents, triangles)


@dataclass(frozen=True)
class RoundedBox(Shape):
    """A cuboid with rounded edges and corners: every point of a box within `radius` of a smaller one."""

    half_extents: Vector
    """Relative half lengths along x, y and z."""
    radius: float
    """Rounding radius as a share of the shortest half length, 0..1 (1: the shortest side is a half circle)."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(half_extents=sample_proportions(rng, 0.2), radius=uniform(rng, 0.15, 0.9))

    def mesh(self) -> Mesh:
        vertices, triangles = cube_grid(12)
        half = np.array(self.half_extents)
        radius = self.radius * half.min()
        # The grid's outer half of each axis covers the rounding, its inner half the flat part.
        core = np.clip(vertices * 2, -1, 1) * (half - radius)
        outward = np.sign(vertices) * np.clip(np.abs(vertices) * 2 - 1, 0, 1)
        bent = np.tan(outward * np.pi / 4)
        bent = np.where(np.abs(vertices) == 1.0, np.sign(vertices), bent)
        length = np.linalg.norm(bent, axis=1, keepdims=True)
        return solid(core + radius * bent / length, triangles, smooth=True)


@dataclass(frozen=True)
class Ellipsoid(Shape):
    """A sphere, stretched."""

    radii: Vector

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(radii=sample_proportions(rng, 0.4))

    def mesh(self) -> Mesh:
        vertices, triangles = icosphere(3)
        return solid(vertices * self.radii, triangles, smooth=True, crease_deg=None)


@dataclass(frozen=True)
class Superquadric(Shape):
    """|x|^(2/e) + |y|^(2/e) to the power e/n, plus |z|^(2/n), is 1 (Barr 1981): pillows, stars, octahedra."""

    radii: Vector
    north_exponent: float
    """n: roundness along meridians; 0 square, 1 round, 2 flat, above 2 pinched."""
    east_exponent: float
    """e: roundness around the equator."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            radii=sample_proportions(rng, 0.4),
            north_exponent=log_uniform(rng, 0.2, 2.6),
            east_exponent=log_uniform(rng, 0.2, 2.6),
        )

    def mesh(self) -> Mesh:
        rings, sides = 33, 48
        north = np.linspace(-np.pi / 2, np.pi / 2, rings)[:, None]
        east = np.linspace(-np.pi, np.pi, sides, endpoint=False)[None, :]
        cos_north = _signed_power(np.cos(north), self.north_exponent)
        points = np.stack(
            np.broadcast_arrays(
                cos_north * _signed_power(np.cos(east), self.east_exponent),
                cos_north * _signed_power(np.sin(east), self.east_exponent),
                _signed_power(np.sin(north), self.north_exponent),
            ),
            axis=-1,
        )
        triangles = grid_triangles(rings, sides, wrap_columns=True)
        vertices, _ = fit_to_cube(points.reshape(-1, 3))
        return solid(vertices * self.radii, triangles, smooth=True, crease_deg=50.0)


def _signed_power(value: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    """Power of the magnitude with the sign kept; rounding noise about zero is zero."""
    magnitude = np.where(np.abs(value) < 1e-12, 0.0, np.abs(value))
    powered: NDArray[np.float64] = np.sign(value) * magnitude**exponent
    return powered

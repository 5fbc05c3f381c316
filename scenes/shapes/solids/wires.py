"""Thin structures, which are hardest for stereo matching: poles, springs, knots, wire frames, lattices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import ConvexHull

from scenes.geometry.building import icosphere, solid, struts, tube
from scenes.geometry.mesh import Mesh
from scenes.random_draws import chance, choose, integer, log_uniform, new_seed, uniform
from scenes.shapes.solids.basic import sample_proportions
from scenes.spec import Shape, Vector


@dataclass(frozen=True)
class Spring(Shape):
    """A helix of round wire."""

    turns: float
    pitch: float
    """Rise per turn relative to the coil's radius."""
    wire_radius: float
    """Relative to the coil's radius."""
    top_radius: float
    """Coil radius at the top relative to the bottom."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        wire = log_uniform(rng, 0.06, 0.3)
        return cls(
            turns=uniform(rng, 2.0, 7.0),
            pitch=uniform(rng, 2.3 * wire, 2.3 * wire + 0.7),
            wire_radius=wire,
            top_radius=uniform(rng, 0.4, 1.0) if chance(rng, 0.4) else 1.0,
        )

    def mesh(self) -> Mesh:
        count = int(28 * self.turns)
        share = np.linspace(0.0, 1.0, count)
        angle = 2 * np.pi * self.turns * share
        coil = 1 + (self.top_radius - 1) * share
        rise = self.pitch * self.turns * share
        path = np.stack([coil * np.cos(angle), coil * np.sin(angle), rise], -1)
        vertices, triangles, uv = tube(path, np.full(count, self.wire_radius), 10)
        return solid(vertices, triangles, uv=uv, smooth=True)


@dataclass(frozen=True)
class TorusKnot(Shape):
    """A closed tube winding p times around and q times through a torus."""

    p: int
    q: int
    ring: float
    """Radius of the torus' tube relative to its ring."""
    tube_radius: float
    """Relative to the ring."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        p, q = choose(rng, [(2, 3), (3, 2), (2, 5), (3, 4), (5, 2), (4, 3), (3, 5), (1, 4), (1, 6)])
        return cls(
            p=p, q=q, ring=uniform(rng, 0.3, 0.5), tube_radius=uniform(rng, 0.25, 0.9) * 0.36 / max(p, 2)
        )

    def mesh(self) -> Mesh:
        t = np.linspace(0.0, 2 * np.pi, 160, endpoint=False)
        reach = 1.0 + self.ring * np.cos(self.q * t)
        path = np.stack(
            [reach * np.cos(self.p * t), reach * np.sin(self.p * t), self.ring * np.sin(self.q * t)], -1
        )
        vertices, triangles, uv = tube(path, np.full(len(t), self.tube_radius), 12, closed=True)
        return solid(vertices, triangles, uv=uv, smooth=True, crease_deg=None)


@dataclass(frozen=True)
class BentWire(Shape):
    """A wire or hose through random points."""

    points: tuple[Vector, ...]
    radius: float
    """In the units of `points`, which fill about [-1, 1]^3."""
    end_radius: float
    """Relative to `radius`."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        walk = np.cumsum(rng.normal(size=(integer(rng, 4, 8), 3)), axis=0)
        walk = 2 * (walk - walk.min(axis=0)) / np.ptp(walk, axis=0).max() - 1
        return cls(
            points=tuple((float(x), float(y), float(z)) for x, y, z in walk),
            radius=log_uniform(rng, 0.03, 0.2),
            end_radius=uniform(rng, 0.2, 1.0),
        )

    def mesh(self) -> Mesh:
        knots = np.array(self.points)
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
        share = np.linspace(0.0, 1.0, 90)
        path = CubicSpline(length, knots)(share * length[-1])
        radius = self.radius * (1 + (self.end_radius - 1) * share)
        vertices, triangles, uv = tube(path, radius, 12)
        return solid(vertices, triangles, uv=uv, smooth=True)


@dataclass(frozen=True)
class Pole(Shape):
    """A thin straight bar, round or square, with cross bars: masts, antennas, fence posts."""

    thickness: float
    """Radius relative to half the length."""
    sides: int
    bars: tuple[tuple[float, float, float], ...]
    """For each cross bar its height (-1..1), half length and direction in degrees."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        count = integer(rng, 0, 5)
        bars = rng.uniform((-0.8, 0.1, 0.0), (1.0, 0.6, 180.0), (count, 3))
        return cls(
            thickness=log_uniform(rng, 0.01, 0.05),
            sides=choose(rng, [4, 6, 12]),
            bars=tuple((float(z), float(reach), float(angle)) for z, reach, angle in bars),
        )

    def mesh(self) -> Mesh:
        bars = np.array(self.bars).reshape(-1, 3)
        angle = np.radians(bars[:, 2])
        zero = np.zeros(len(bars))
        reach = np.stack([np.cos(angle) * bars[:, 1], np.sin(angle) * bars[:, 1], zero], -1)
        middle = np.stack([zero, zero, bars[:, 0] * (1 - self.thickness)], -1)
        start = np.concatenate([[(0.0, 0.0, -1.0)], middle - reach])
        end = np.concatenate([[(0.0, 0.0, 1.0)], middle + reach])
        radius = np.full(len(start), self.thickness * 0.7)
        radius[0] = self.thickness
        return solid(*struts(start, end, radius, radius, self.sides))


@dataclass(frozen=True)
class WireFrame(Shape):
    """The edges of a polyhedron as bars: geodesic domes, cages, crystal frames."""

    corners: int
    """Number of random corners; 0 for the 42 of a subdivided icosahedron."""
    radii: Vector
    bar_radius: float
    """Relative to the longest half axis."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            corners=integer(rng, 5, 24) if chance(rng, 0.8) else 0,
            radii=sample_proportions(rng, 0.5),
            bar_radius=log_uniform(rng, 0.012, 0.06),
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        if self.corners:
            points = np.random.default_rng(self.seed).normal(size=(self.corners, 3))
            points /= np.linalg.norm(points, axis=1, keepdims=True)
            triangles = ConvexHull(points).simplices.astype(np.int64)
        else:
            points, triangles = icosphere(1)
        edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        points = points * self.radii
        radius = np.full(len(edges), self.bar_radius)
        return solid(*struts(points[edges[:, 0]], points[edges[:, 1]], radius, radius, 6))


@dataclass(frozen=True)
class Lattice(Shape):
    """A three-dimensional grid of square bars: scaffolds, shelves, racks."""

    cells: tuple[int, int, int]
    """Number of cells along x, y and z."""
    bar: float
    """Half thickness of the bars relative to a cell."""

    popularity: ClassVar[float] = 0.7

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        x, y, z = (int(count) for count in rng.integers(1, 4, 3))
        return cls(cells=(x, y, z), bar=log_uniform(rng, 0.03, 0.13))

    def mesh(self) -> Mesh:
        starts, ends = [], []
        for axis in range(3):
            others = [other for other in range(3) if other != axis]
            a, b = (grid.ravel() for grid in np.meshgrid(*(np.arange(self.cells[o] + 1.0) for o in others)))
            start = np.zeros((len(a), 3))
            start[:, others] = np.stack([a, b], -1)
            end = start.copy()
            # Bars of different directions end at slightly different planes, so that no faces coincide.
            start[:, axis] -= self.bar * (0.8 + 0.1 * axis)
            end[:, axis] = self.cells[axis] + self.bar * (0.8 + 0.1 * axis)
            starts.append(start)
            ends.append(end)
        start, end = np.concatenate(starts), np.concatenate(ends)
        # struts() turns its square sections by 45 degrees, so the radius reaches the bars' corners; each
        # direction has its own thickness for the same reason as above.
        thickness = np.repeat([0.94, 1.0, 1.06], [len(part) for part in starts])
        radius = self.bar * np.sqrt(2.0) * thickness
        return solid(*struts(start, end, radius, radius, 4))

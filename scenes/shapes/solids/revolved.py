"""Surfaces of revolution, some of them bent, twisted and tapered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from scenes.geometry.building import Vertices, box_uv, revolve, solid, tube
from scenes.geometry.mesh import Mesh
from scenes.random_draws import chance, integer, log_uniform, uniform
from scenes.spec import Shape


def _capped(radius: NDArray[np.float64], height: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """A profile with flat caps: a point on the axis at either end."""
    return np.concatenate([[0.0], radius, [0.0]]), np.concatenate([height[:1], height, height[-1:]])


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder or, with few sides, a prism; with a `top_radius` a frustum or a cone."""

    half_height: float
    """Relative to the bottom radius."""
    top_radius: float
    """Relative to the bottom radius; 0 is a cone."""
    sides: int

    popularity: ClassVar[float] = 1.5

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        kind = rng.random()
        top = 1.0 if kind < 0.6 else 0.0 if kind < 0.8 else uniform(rng, 0.2, 1.4)
        sides = integer(rng, 3, 8) if chance(rng, 0.35) else 48
        return cls(half_height=log_uniform(rng, 0.25, 3.0), top_radius=top, sides=sides)

    def mesh(self) -> Mesh:
        radius, height = _capped(
            np.array([1.0, self.top_radius]), np.array([-self.half_height, self.half_height])
        )
        vertices, triangles = revolve(radius, height, self.sides)
        return solid(vertices, triangles, smooth=self.sides > 12)


@dataclass(frozen=True)
class DeformedCylinder(Shape):
    """A cylinder with a lobed section, tapered, twisted and bent."""

    half_height: float
    """Relative to the radius."""
    taper: float
    """Radius at the top relative to the bottom."""
    bulge: float
    """Change of radius half way up, as a share of the radius."""
    twist_deg: float
    bend_deg: float
    """Angle between the directions of the two ends."""
    lobes: int
    lobe_depth: float
    """Amplitude of the lobes as a share of the radius."""

    popularity: ClassVar[float] = 2.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            half_height=log_uniform(rng, 0.8, 3.5),
            taper=uniform(rng, 0.25, 1.1),
            bulge=uniform(rng, -0.4, 0.5),
            twist_deg=uniform(rng, -270.0, 270.0),
            bend_deg=uniform(rng, 0.0, 150.0),
            lobes=integer(rng, 2, 6),
            lobe_depth=uniform(rng, 0.0, 0.3) if chance(rng, 0.7) else 0.0,
        )

    def mesh(self) -> Mesh:
        level = np.linspace(-1.0, 1.0, 33)
        radius, height = _capped(np.ones(33), level * self.half_height)
        straight, triangles = revolve(radius, height, 40)
        level = straight[:, 2] / self.half_height
        theta = np.arctan2(straight[:, 1], straight[:, 0])
        size = 1 + (self.taper - 1) * (level + 1) / 2 + self.bulge * (1 - level**2)
        size = size * (1 + self.lobe_depth * np.cos(self.lobes * theta))
        turned = theta + np.radians(self.twist_deg) * level / 2
        reach = np.hypot(straight[:, 0], straight[:, 1]) * size
        vertices = np.stack([reach * np.cos(turned), reach * np.sin(turned), straight[:, 2]], -1)
        uv = box_uv(vertices, triangles)
        return solid(
            _bend(vertices, np.radians(self.bend_deg), self.half_height), triangles, uv=uv, smooth=True
        )


def _bend(vertices: Vertices, angle: float, half_height: float) -> Vertices:
    """Bend the z axis into a circular arc in the x-z plane, spanning `angle` over 2 * half_height.

    The bend is limited so that the inner side (x towards the arc's centre) never folds over itself.
    """
    x, y, z = vertices.T
    widest = float(np.abs(x).max())
    angle = min(angle, 1.8 * half_height / widest)
    if angle < 1e-6:
        return vertices
    arc_radius = 2 * half_height / angle
    phi = z / arc_radius
    return np.stack([arc_radius - (arc_radius - x) * np.cos(phi), y, (arc_radius - x) * np.sin(phi)], -1)


@dataclass(frozen=True)
class Torus(Shape):
    """A ring, or with `arc_deg` below 360 a bent bar with flat ends."""

    tube_radius: float
    """Relative to the ring's radius."""
    arc_deg: float
    sides: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            tube_radius=log_uniform(rng, 0.08, 0.5),
            arc_deg=360.0 if chance(rng, 0.6) else uniform(rng, 120.0, 320.0),
            sides=integer(rng, 3, 6) if chance(rng, 0.25) else 20,
        )

    def mesh(self) -> Mesh:
        closed = self.arc_deg >= 360.0
        angle = np.radians(np.linspace(0.0, self.arc_deg, 64, endpoint=not closed))
        path = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], -1)
        vertices, triangles, uv = tube(path, np.full(64, self.tube_radius), self.sides, closed=closed)
        return solid(vertices, triangles, uv=uv, smooth=self.sides > 12)


@dataclass(frozen=True)
class Lathe(Shape):
    """A vase, a chess piece, a baluster: a smooth random profile turned about the axis."""

    radii: tuple[float, ...]
    """Profile radii at equal steps of height, bottom to top."""
    half_height: float
    """Relative to a profile radius of 1."""
    sides: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        radii = np.exp(rng.normal(-0.5, 0.45, integer(rng, 4, 8))).clip(0.12, 1.2)
        return cls(
            radii=tuple(float(radius) for radius in radii),
            half_height=log_uniform(rng, 0.7, 2.2),
            sides=integer(rng, 5, 9) if chance(rng, 0.25) else 40,
        )

    def mesh(self) -> Mesh:
        knots = np.linspace(-1.0, 1.0, len(self.radii))
        level = np.linspace(-1.0, 1.0, 49)
        # Monotone between its knots, so the radius never undershoots to zero or below.
        radius, height = _capped(PchipInterpolator(knots, self.radii)(level), level * self.half_height)
        vertices, triangles = revolve(radius, height, self.sides)
        return solid(vertices, triangles, smooth=self.sides > 12, crease_deg=50.0)

"""What people wear and carry: hats, helmets, shields, jars, lamps (turned on a lathe), blades."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.geometry.building import Part, joined, revolve, tube
from scenes.geometry.polyhedra import loft
from scenes.random_draws import uniform
from scenes.shapes.anchored import PartedShape
from scenes.spec import Vector

Profile = tuple[tuple[float, float], ...]
"""Radius and height of points of a closed profile, from its foot on the axis around its outside back to the axis."""


@dataclass(frozen=True)
class Turned(PartedShape):
    """A surface of revolution about an axis through `base`: hats, helmets, shields, jars, glass balls."""

    profile: Profile
    base: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    sides: int = 28

    popularity: ClassVar[float] = 0.0
    smooth: ClassVar[bool] = True
    crease_deg: ClassVar[float | None] = 45.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(cone_hat(uniform(rng, 0.8, 1.0), uniform(rng, 0.3, 0.8)))

    def parts(self) -> dict[str, Part]:
        radius, height = np.array(self.profile).T
        vertices, triangles = revolve(radius, height, self.sides)
        return {"turned": (_pointing(self.axis).apply(vertices) + self.base, triangles)}


def _pointing(axis: Vector) -> Rotation:
    """The shortest turn of the z axis to an axis."""
    aim = np.array(axis) / np.linalg.norm(axis)
    across = np.cross((0.0, 0.0, 1.0), aim)
    angle = float(np.arctan2(np.linalg.norm(across), aim[2]))
    if np.linalg.norm(across) < 1e-9:
        return Rotation.from_rotvec((angle, 0.0, 0.0))
    return Rotation.from_rotvec(across / np.linalg.norm(across) * angle)


def dome(radius: float, height: float, thickness: float, brim: float = 0.0) -> Profile:
    """A shell open below, with a brim: helmets, bowls upside down, shields, brimmed hats."""
    angle = np.linspace(0.0, np.pi / 2, 9)
    inner = [
        (float((radius - thickness) * np.sin(t)), float((height - thickness) * np.cos(t))) for t in angle
    ]
    rim = [(radius + brim, -0.3 * brim - 0.5 * thickness), (radius + brim, -0.3 * brim + 0.5 * thickness)]
    rim = rim if brim > 0 else [(radius, -0.5 * thickness)]
    outer = [(float(radius * np.sin(t)), float(height * np.cos(t))) for t in angle[::-1]]
    return (*inner, *rim, *outer[:-1], (0.0, height))


def cone_hat(radius: float, height: float) -> Profile:
    """A straw hat, pointed."""
    return (
        (0.0, 0.75 * height), (0.92 * radius, -0.06 * height), (radius, -0.04 * height),
        (0.97 * radius, 0.05 * height), (0.45 * radius, 0.52 * height), (0.08 * radius, 0.97 * height), (0.0, height),
    )  # fmt: skip


def jar(rng: np.random.Generator, slenderness: float) -> Profile:
    """A jar or bottle of height 1 with a neck, its radius about half of 1 / `slenderness`."""
    belly, neck, lip = (
        0.5 / slenderness,
        uniform(rng, 0.12, 0.3) / slenderness,
        uniform(rng, 0.16, 0.36) / slenderness,
    )
    height = np.linspace(0.0, 1.0, 16)
    widest = uniform(rng, 0.3, 0.6)
    swell = np.exp(-(((height - widest) / uniform(rng, 0.22, 0.36)) ** 2))
    radius = neck + (belly - neck) * swell
    radius[-1] = lip
    rim = [(0.75 * lip, 1.0), (0.7 * neck, 0.86), (0.0, 0.84)]
    return ((0.0, 0.0), *((float(r), float(h)) for r, h in zip(radius, height, strict=True)), *rim)


def ball(radius: float) -> Profile:
    """A ball about the base."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 13)
    points = [(float(radius * np.cos(t)), float(radius * np.sin(t))) for t in angle]
    return ((0.0, points[0][1]), *points[1:-1], (0.0, points[-1][1]))


@dataclass(frozen=True)
class Blade(PartedShape):
    """A straight sword from its pommel along a direction: a grip, a guard, a double-edged blade."""

    hand: Vector
    aim: Vector
    length: float
    width: float
    """Half the blade's width."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), uniform(rng, 0.4, 0.6), uniform(rng, 0.012, 0.02))

    def parts(self) -> dict[str, Part]:
        w, thin = self.width, 0.25 * self.width
        section = np.array([(w, 0.0), (0.0, thin), (-w, 0.0), (0.0, -thin)])
        level = np.array([0.05, 0.05 + 0.85 * self.length, 0.05 + self.length])
        rings = np.stack([_ring(section * size, z) for size, z in zip((1.0, 0.75, 0.06), level, strict=True)])
        guard = np.array([(-3.5 * w, 0.0, 0.05), (0.0, 0.0, 0.045), (3.5 * w, 0.0, 0.05)])
        grip = np.array([(0.0, 0.0, -0.06), (0.0, 0.0, 0.0), (0.0, 0.0, 0.045)])
        bars = [tube(path, np.full(3, radius), 7)[:2] for path, radius in ((guard, 0.6 * w), (grip, 0.011))]
        vertices, triangles = joined(loft(rings), *bars)
        return {"blade": (_pointing(self.aim).apply(vertices) + self.hand, triangles)}


def _ring(section: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    return np.column_stack([section, np.full(len(section), level)])

"""Rock with structure: ledges of layered cliffs, scree, crystals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from scenes.geometry.building import Part, icosphere, joined
from scenes.geometry.polyhedra import loft
from scenes.random_draws import integer, new_seed, uniform
from scenes.shapes.anchored import PartedShape
from scenes.shapes.solids.organic import wave_noise


@dataclass(frozen=True)
class Outcrop(PartedShape):
    """Bedded rock that stands out of the ground: hard beds jut out as ledges, soft ones recede, joints cut through."""

    height: float
    """Relative to the radius of its foot."""
    beds: int
    ledges: float
    """How far beds jut out and recede, relative to the radius."""
    taper: float
    """Radius at the top relative to the foot's."""
    joints: int
    """Clefts around it."""
    dip: float
    """Slope of the beds."""
    seed: int

    popularity: ClassVar[float] = 0.0
    smooth: ClassVar[bool] = True
    crease_deg: ClassVar[float | None] = 32.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            height=uniform(rng, 0.5, 1.9),
            beds=integer(rng, 5, 11),
            ledges=uniform(rng, 0.05, 0.16),
            taper=uniform(rng, 0.45, 0.95),
            joints=integer(rng, 3, 8),
            dip=float(rng.normal(0.0, 0.12)),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        sides = 60
        theta = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
        edges = np.concatenate([[0.0], np.sort(rng.uniform(0.05, 0.95, self.beds - 1)), [1.0]])
        jut = rng.uniform(-1.0, 1.0, self.beds) * self.ledges
        around = np.stack([np.cos(theta), np.sin(theta)], -1)
        outline = np.exp(0.22 * wave_noise(rng, around, 1.2, 0.8, 12))
        clefts = np.zeros(sides)
        for at in rng.uniform(0.0, 2 * np.pi, self.joints):
            apart = np.abs((theta - at + np.pi) % (2 * np.pi) - np.pi)
            clefts += rng.uniform(0.06, 0.2) * np.exp(-((apart / 0.09) ** 2))
        rings = []
        for bed in range(self.beds):
            chips = 0.05 * wave_noise(rng, around, 6.0, 0.6, 12)
            for level in (edges[bed] + 0.006, 0.5 * (edges[bed] + edges[bed + 1]), edges[bed + 1] - 0.006):
                bulge = 1.0 if 2 * level > edges[bed] + edges[bed + 1] else 0.985
                radius = (1 + (self.taper - 1) * level) * outline * (1 + jut[bed] + chips) * bulge - clefts
                z = self.height * (level + self.dip * around[:, 0] * min(1.0, 3 * level)) - 0.12
                rings.append(np.column_stack([np.maximum(radius, 0.15)[:, None] * around, z]))
        return {"stone": loft(np.array(rings))}


@dataclass(frozen=True)
class Scree(PartedShape):
    """Stones of all sizes, strewn over a disc and half sunk into it."""

    stones: int
    largest: float
    """Radius of the largest stone, relative to the disc's."""
    angular: float
    """0 pebbles .. 1 splinters."""
    seed: int

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(integer(rng, 30, 60), uniform(rng, 0.08, 0.2), uniform(rng, 0.0, 1.0), new_seed(rng))

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        ball, faces = icosphere(1)
        size = self.largest * np.exp(-1.1 * rng.exponential(1.0, self.stones))
        size = np.clip(size, 0.12 * self.largest, self.largest)
        place, heading = np.sqrt(rng.random(self.stones)), rng.uniform(0.0, 2 * np.pi, self.stones)
        stones = []
        for index in range(self.stones):
            knocked = ball * (1 + 0.32 * self.angular * rng.uniform(-1.0, 0.4, (len(ball), 1)))
            stone = knocked * rng.uniform(0.6, 1.2, 3) * (1.0, 1.0, 0.75) * size[index]
            turn = rng.uniform(0.0, 2 * np.pi)
            spin = np.array([(np.cos(turn), -np.sin(turn)), (np.sin(turn), np.cos(turn))])
            stone[:, :2] = stone[:, :2] @ spin.T + place[index] * np.array(
                (np.cos(heading[index]), np.sin(heading[index]))
            )
            stone[:, 2] += 0.25 * size[index]
            stones.append((stone, faces))
        return {"stone": joined(*stones)}


@dataclass(frozen=True)
class Crystals(PartedShape):
    """Six-sided prisms with pointed ends that grow out of one place: quartz, ice."""

    prisms: int
    slenderness: float
    spread_deg: float
    seed: int

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(integer(rng, 2, 7), uniform(rng, 3.0, 7.0), uniform(rng, 15.0, 55.0), new_seed(rng))

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        theta = np.linspace(0.0, 2 * np.pi, 6, endpoint=False)
        prisms = []
        for index in range(self.prisms):
            length = 1.0 if index == 0 else rng.uniform(0.3, 0.85)
            radius = length**0.6 / self.slenderness * rng.uniform(0.75, 1.2)
            lean = np.radians(self.spread_deg) * (0.2 if index == 0 else rng.uniform(0.4, 1.0))
            heading = rng.uniform(0.0, 2 * np.pi)
            axis = np.array((np.sin(lean) * np.cos(heading), np.sin(lean) * np.sin(heading), np.cos(lean)))
            side = np.cross(axis, (0.3, 0.9, 0.1))
            side /= np.linalg.norm(side)
            ring = np.outer(np.cos(theta), side) + np.outer(np.sin(theta), np.cross(axis, side))
            ring = ring * rng.uniform(0.8, 1.15, (6, 1))
            levels = ((-0.12, 0.9), (0.82 * length, 1.0), (length, 0.06))
            prisms.append(loft(np.stack([axis * at + radius * wide * ring for at, wide in levels])))
        return {"crystal": joined(*prisms)}

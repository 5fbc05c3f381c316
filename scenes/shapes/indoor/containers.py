"""Cartons, packages and baskets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part
from scenes.geometry.polyhedra import hexahedra
from scenes.random_draws import chance, choose, integer, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, fronted, lathe, slabs, surfaces


@dataclass(frozen=True)
class Carton(IndoorShape):
    """A cardboard box, closed and taped or open with its flaps out."""

    width: float
    depth: float
    height: float
    open: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        s = choose(rng, [0.16, 0.28, 0.4])
        width, depth, height = (s * rng.uniform(0.7, 1.4, 3)).tolist()
        return cls(width, depth, height, chance(rng, 0.3))

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth / 2, self.height
        if not self.open:
            tape = slabs((-0.025, -d - 0.001, h - 0.08, 0.025, d + 0.001, h + 0.001))
            return surfaces(cardboard=[slabs((-w, -d, 0.0, w, d, h))], plastic_tape=[tape])
        t = 0.004
        walls = slabs(
            (-w + t / 2, -d + t / 2, 0.0002, w - t / 2, d - t / 2, t),
            (-w + 0.0003, -d + t / 2, 0.0001, -w + t, d - t / 2, h - 0.0002),
            (w - t, -d + t / 2, 0.0001, w - 0.0003, d - t / 2, h - 0.0002),
            (-w, -d, 0.0, w, -d + t, h),
            (-w, d - t, 0.0, w, d, h),
        )
        flaps = []
        for side in (-1.0, 1.0):
            ring = np.array([(side * (w + 0.0005), h), (side * (w + 0.4 * d), h + 0.25 * d)])
            low = [(ring[0, 0], y, ring[0, 1] + dz) for y in (-d, d) for dz in (-t, 0.0)]
            high = [(ring[1, 0], y, ring[1, 1] + dz) for y in (-d, d) for dz in (-t, 0.0)]
            corners = np.array([low[0], low[1], low[3], low[2], high[0], high[1], high[3], high[2]])
            flaps.append(hexahedra(corners[None]))
        return surfaces(cardboard=[walls, *flaps])


@dataclass(frozen=True)
class Package(IndoorShape):
    """A printed package: a cereal box, a tin, a game, a folder."""

    width: float
    depth: float
    height: float
    tin: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        if chance(rng, 0.3):
            r = uniform(rng, 0.035, 0.06)
            return cls(2 * r, 2 * r, uniform(rng, 0.08, 0.2), True)
        return cls(uniform(rng, 0.1, 0.3), uniform(rng, 0.04, 0.16), uniform(rng, 0.06, 0.3), False)

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth / 2, self.height
        if self.tin:
            return surfaces(
                print=[lathe(((w, 0.004), (w, h - 0.004)), sides=24)],
                chrome=[
                    lathe(((w + 0.001, 0.0), (w + 0.001, 0.004)), sides=24),
                    lathe(((w + 0.001, h - 0.004), (w + 0.001, h)), sides=24),
                ],
            )
        return {"picture package": fronted((-w, -d, 0.0, w, d, h))}


@dataclass(frozen=True)
class Basket(IndoorShape):
    """A basket or crate of bars with gaps between them: a lattice."""

    width: float
    depth: float
    height: float
    made_of: str
    bars: int
    """Along the width."""
    wire: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        wire = chance(rng, 0.5)
        return cls(
            uniform(rng, 0.25, 0.5), uniform(rng, 0.2, 0.36), uniform(rng, 0.15, 0.35),
            "chrome" if wire and chance(rng, 0.5) else choose(rng, ["wood", "plastic"]), integer(rng, 5, 12), wire,
        )  # fmt: skip

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth / 2, self.height
        bodies: list[Part] = []
        if self.wire:
            across = max(3, round(self.bars * d / w))
            levels = np.linspace(0.004, h, 5).tolist()
            bodies += [
                slabs(
                    *((x - 0.002, s * d - 0.002, 0.0, x + 0.002, s * d + 0.002, h) for s in (-1, 1)),
                    (x - 0.002, -d, 0.0, x + 0.002, d, 0.004),
                )
                for x in np.linspace(-w, w, self.bars).tolist()
            ]
            bodies += [
                slabs(*((s * w - 0.002, y - 0.002, 0.0, s * w + 0.002, y + 0.002, h) for s in (-1, 1)))
                for y in np.linspace(-d, d, across + 2)[1:-1].tolist()
            ]
            bodies += [_ring(w, d, z, 0.0025) for z in levels]
            return surfaces(**{self.made_of: bodies})
        posts = slabs(
            *(
                (x - 0.014, y - 0.014, 0.0, x + 0.014, y + 0.014, h)
                for x in (-w + 0.016, w - 0.016)
                for y in (-d + 0.016, d - 0.016)
            )
        )
        slats = max(2, round(h / 0.07))
        for k in range(slats):
            z = (k + 0.1) * h / slats
            top = z + 0.62 * h / slats
            bodies.append(
                slabs(
                    (-w, -d - 0.006, z, w, -d, top),
                    (-w, d, z, w, d + 0.006, top),
                    (-w - 0.006, -d - 0.003, z, -w, d + 0.003, top - 0.002),
                    (w, -d - 0.003, z, w + 0.006, d + 0.003, top - 0.002),
                )
            )
        bodies.append(slabs((-w, -d, 0.005, w, d, 0.012)))
        return surfaces(**{self.made_of: [posts, *bodies]})


def _ring(w: float, d: float, z: float, r: float) -> Part:
    return slabs(
        (-w - r, -d - r, z - r, w + r, -d + r, z + r),
        (-w - r, d - r, z - r, w + r, d + r, z + r),
        (-w - 1.2 * r, -d, z - 0.9 * r, -w + 1.2 * r, d, z + 0.9 * r),
        (w - 1.2 * r, -d, z - 0.9 * r, w + 1.2 * r, d, z + 0.9 * r),
    )

"""Stairs and railings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part
from scenes.random_draws import chance, choose, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, rod, slabs, surfaces


@dataclass(frozen=True)
class Stairs(IndoorShape):
    """A flight of stairs along a wall, from the anchor towards +x; its wall side is at y = 0."""

    steps: int
    rise: float
    tread: float
    width: float
    open: bool
    """Whether there is nothing between the treads."""
    bars: int
    """Balusters a step."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls.up_to(rng, uniform(rng, 2.4, 2.9))

    @classmethod
    def up_to(cls, rng: np.random.Generator, height: float) -> Self:
        """A flight that climbs to a height."""
        steps = round(height / uniform(rng, 0.16, 0.19))
        return cls(
            steps,
            height / steps,
            uniform(rng, 0.24, 0.29),
            uniform(rng, 0.85, 1.1),
            chance(rng, 0.4),
            choose(rng, [1, 2]),
        )

    @property
    def length(self) -> float:
        """In plan."""
        return self.steps * self.tread

    def parts(self) -> dict[str, Surface]:
        w, t, r = self.width, self.tread, self.rise
        treads, body, bars = [], [], []
        for k in range(self.steps):
            x, z = k * t, (k + 1) * r
            treads.append((x - 0.03, 0.01, z - 0.035, x + t + 0.005, w, z))
            if not self.open:
                body.append((x, 0.01, 0.0 if k < 3 else z - r * 2.2, x + t, w - 0.015, z - 0.035))
            for b in range(self.bars):
                at = x + (b + 0.5) * t / self.bars
                bars.append(
                    rod(
                        ((at, w - 0.05, z - 0.01), (at, w - 0.05, z + 0.86 + (b + 0.5) / self.bars * r)),
                        0.009,
                        6,
                    )
                )
        rail = rod(((-0.05, w - 0.05, 0.9), (self.length, w - 0.05, self.steps * r + 0.9)), 0.026, 10)
        post = slabs((-0.07, w - 0.09, 0.0, 0.01, w - 0.01, 1.0))
        stringers: list[Part] = []
        if self.open:
            stringers += [
                rod(((0.0, y, 0.06), (self.length - t, y, self.steps * r - 0.12)), 0.05, 4)
                for y in (0.05, w - 0.08)
            ]
        return surfaces(
            wood_treads=[slabs(*treads)],
            enamel=[slabs(*body)] if body else stringers,
            metal_balusters=bars,
            wood_rail=[rail, post],
        )


@dataclass(frozen=True)
class Railing(IndoorShape):
    """A straight railing of upright bars along x, centred."""

    length: float
    height: float
    gap: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 1.5, 4.0), uniform(rng, 0.9, 1.05), uniform(rng, 0.08, 0.13))

    def parts(self) -> dict[str, Surface]:
        half = self.length / 2
        bars = [
            rod(((x, 0.0, 0.06), (x, 0.0, self.height - 0.02)), 0.008, 6)
            for x in np.linspace(-half + 0.03, half - 0.03, round(self.length / self.gap)).tolist()
        ]
        posts = [
            slabs((x - 0.03, -0.03, 0.0, x + 0.03, 0.03, self.height)) for x in (-half + 0.03, half - 0.03)
        ]
        rails = [rod(((-half, 0.0, z), (half, 0.0, z)), 0.02, 8) for z in (0.07, self.height)]
        return surfaces(metal=[*bars, *posts], wood_rail=rails)

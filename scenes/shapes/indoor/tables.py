"""Tables, desks and benches to work at."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part
from scenes.random_draws import chance, choose, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import BoxCorners, IndoorShape, Top, lathe, legs, rod, slabs, surfaces


@dataclass(frozen=True)
class Table(IndoorShape):
    """A table centred on its anchor: four legs, a trestle or a column, under a rectangular or round top."""

    width: float
    depth: float
    height: float
    stand: str
    """legs, tapered, sled or column."""
    round: bool
    """Whether the top is a disc of the diameter `width`."""
    board: str
    """What the top is made of."""
    framing: str

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls.dining(rng)

    @classmethod
    def dining(cls, rng: np.random.Generator) -> Self:
        """A table to eat or work at."""
        disc = chance(rng, 0.2)
        width = uniform(rng, 0.9, 1.2) if disc else uniform(rng, 1.1, 2.0)
        return cls._of(rng, width, uniform(rng, 0.72, 0.95), uniform(rng, 0.71, 0.77), disc)

    @classmethod
    def low(cls, rng: np.random.Generator) -> Self:
        """A table before a sofa or beside it."""
        disc = chance(rng, 0.35)
        return cls._of(rng, uniform(rng, 0.55, 1.2), uniform(rng, 0.45, 0.65), uniform(rng, 0.36, 0.5), disc)

    @classmethod
    def _of(cls, rng: np.random.Generator, width: float, depth: float, height: float, disc: bool) -> Self:
        board = choose(rng, ["wood", "lacquer", "glass", "stone"], [0.6, 0.22, 0.08, 0.1])
        stand = "column" if disc else choose(rng, ["legs", "tapered", "sled"], [0.45, 0.35, 0.2])
        metal = stand in ("sled", "column") or board == "glass" or chance(rng, 0.2)
        return cls(
            width=width,
            depth=width if disc else depth,
            height=height,
            stand=stand,
            round=disc,
            board=board,
            framing=choose(rng, ["chrome", "metal"]) if metal else "wood",
        )

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth / 2, self.height
        thick = 0.012 if self.board == "glass" else 0.03
        under = h - thick
        board: Part = lathe(((w, under), (w, h)), sides=36) if self.round else slabs((-w, -d, under, w, d, h))
        frame: list[Part] = []
        if self.stand == "column":
            foot = 0.55 * w
            frame.append(lathe(((foot, 0.0), (foot * 0.9, 0.02), (0.04, 0.05), (0.04, under)), sides=24))
        elif self.stand == "sled":
            low = 0.02 * math.cos(math.pi / 6)  # The rods are hexagons that lie on a flat side.
            for x in (-w + 0.12, w - 0.12):
                path = (
                    (x, -d + 0.06, under),
                    (x, -d + 0.06, low),
                    (x, d - 0.06, low),
                    (x, d - 0.06, under),
                )
                frame += [rod((one, two), 0.02, 6) for one, two in itertools.pairwise(path)]
            frame.append(rod(((-w + 0.12, 0.0, under - 0.03), (w - 0.12, 0.0, under - 0.03)), 0.018, 6))
        else:
            thickness = 0.045 if self.height < 0.6 else 0.06
            frame += legs(w, d, under, thickness, tapered=self.stand == "tapered", inset=0.06)
            a, b = w - 0.06, d - 0.06
            frame.append(
                slabs(
                    (-a, -b - 0.011, under - 0.08, a, -b + 0.011, under),
                    (-a, b - 0.011, under - 0.08, a, b + 0.011, under),
                    (-a - 0.011, -b, under - 0.08, -a + 0.011, b, under),
                    (a - 0.011, -b, under - 0.08, a + 0.011, b, under),
                )
            )
        name = self.board if self.board != self.framing else f"{self.board}_top"
        return surfaces(**{name: [board], self.framing: frame})

    def tops(self) -> tuple[Top, ...]:
        share = 0.68 if self.round else 0.94
        w, d = share * self.width / 2, share * self.depth / 2
        return (Top((-w, -d), (w, d), self.height, 0.7),)


@dataclass(frozen=True)
class Desk(IndoorShape):
    """A desk at a wall, with a pedestal of drawers on one side."""

    width: float
    depth: float
    height: float
    drawers: int
    """0 for none."""
    board: str
    framing: str

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            width=uniform(rng, 1.1, 1.8),
            depth=uniform(rng, 0.6, 0.8),
            height=uniform(rng, 0.7, 0.76),
            drawers=choose(rng, [0, 3, 4]),
            board=choose(rng, ["wood", "lacquer"], [0.65, 0.35]),
            framing=choose(rng, ["metal", "wood", "chrome"]),
        )

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth, self.height
        under = h - 0.028
        stand = [
            (
                vertices + np.array((0.0, d / 2, 0.0)),
                triangles,
            )
            for vertices, triangles in legs(w, d / 2, under, 0.045, inset=0.04)
        ]
        stand.append(slabs((-w + 0.05, 0.05, h - 0.35, w - 0.05, 0.065, under)))
        fronts: list[BoxCorners] = []
        knobs: list[Part] = []
        if self.drawers:
            x0, x1, low = w - 0.48, w - 0.08, 0.08
            fronts.append((x0, 0.08, low, x1, d - 0.04, under - 0.005))
            step = (under - 0.005 - low) / self.drawers
            for k in range(self.drawers):
                z = low + k * step
                fronts.append((x0, d - 0.05, z + 0.004, x1, d - 0.02, z + step - 0.004))
                knobs.append(
                    slabs((x0 + 0.12, d - 0.025, z + step - 0.06, x1 - 0.12, d - 0.005, z + step - 0.045))
                )
        return surfaces(
            **{
                f"{self.board}_top": [slabs((-w, 0.0, under, w, d, h))],
                self.framing: stand,
                "lacquer_drawers": [slabs(*fronts)] if fronts else [],
                "chrome_handles": knobs,
            }
        )

    def tops(self) -> tuple[Top, ...]:
        w = self.width / 2 - 0.04
        return (Top((-w, 0.04), (w, self.depth - 0.04), self.height, 0.8),)


@dataclass(frozen=True)
class Workbench(IndoorShape):
    """A heavy bench with a shelf below and a vice at its front."""

    width: float
    depth: float
    height: float
    vice: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 1.4, 2.2), uniform(rng, 0.6, 0.75), uniform(rng, 0.82, 0.92), chance(rng, 0.6)
        )

    def parts(self) -> dict[str, Surface]:
        w, d, h = self.width / 2, self.depth, self.height
        stand = [
            (vertices + np.array((0.0, d / 2, 0.0)), triangles)
            for vertices, triangles in legs(w, d / 2, h - 0.06, 0.09, inset=0.09)
        ]
        stand.append(slabs((-w + 0.05, 0.05, 0.2, w - 0.05, d - 0.05, 0.23)))
        vice: list[Part] = []
        if self.vice:
            x = -w + 0.3
            vice = [
                slabs(
                    (x - 0.09, d - 0.02, h - 0.14, x + 0.09, d + 0.04, h + 0.07),
                    (x - 0.09, d + 0.11, h - 0.14, x + 0.09, d + 0.16, h + 0.07),
                    (x - 0.03, d + 0.0, h - 0.12, x + 0.03, d + 0.15, h - 0.07),
                ),
                rod(((x, d + 0.1, h - 0.05), (x, d + 0.25, h - 0.05)), 0.013),
                rod(((x - 0.11, d + 0.24, h - 0.05), (x + 0.11, d + 0.24, h - 0.05)), 0.008),
            ]
        return surfaces(wood=[slabs((-w, 0.0, h - 0.06, w, d, h))], wood_stand=stand, metal=vice)

    def tops(self) -> tuple[Top, ...]:
        w = self.width / 2 - 0.06
        return (
            Top((-w, 0.05), (w, self.depth - 0.08), self.height, 0.5),
            Top((-w, 0.08), (w, self.depth - 0.08), 0.23, 0.45),
        )

"""Toys, tools and plants in pots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part, tube
from scenes.geometry.leaves import arched, around, strips, width_directions
from scenes.geometry.polyhedra import turned
from scenes.geometry.stems import leaf_cloud
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, cushion, lathe, rod, slabs, surfaces


@dataclass(frozen=True)
class Toy(IndoorShape):
    """A ball, a tower of blocks, a soft bear or a wooden train."""

    form: str
    size: float
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(choose(rng, ["ball", "blocks", "bear", "train"]), uniform(rng, 0.1, 0.28), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng, s = np.random.default_rng(self.seed), self.size
        if self.form == "ball":
            return surfaces(print=[cushion((-s / 2, -s / 2, 0.0, s / 2, s / 2, s), 2.0)])
        if self.form == "bear":
            fur = [
                cushion((-0.3 * s, -0.22 * s, 0.0, 0.3 * s, 0.26 * s, 0.62 * s), 2.2),
                cushion((-0.22 * s, -0.16 * s, 0.55 * s, 0.22 * s, 0.24 * s, 0.98 * s), 2.2),
                *(
                    cushion((x - 0.11 * s, 0.1 * s, 0.0, x + 0.11 * s, 0.52 * s, 0.2 * s), 2.4)
                    for x in (-0.2 * s, 0.2 * s)
                ),
                *(
                    cushion((x - 0.08 * s, -0.02 * s, 0.28 * s, x + 0.08 * s, 0.3 * s, 0.48 * s), 2.4)
                    for x in (-0.3 * s, 0.3 * s)
                ),
                *(
                    cushion((x - 0.08 * s, -0.03 * s, 0.88 * s, x + 0.08 * s, 0.05 * s, 1.05 * s), 2.2)
                    for x in (-0.17 * s, 0.17 * s)
                ),
            ]
            eyes = [
                cushion((x - 0.02 * s, 0.2 * s, 0.78 * s, x + 0.02 * s, 0.25 * s, 0.83 * s), 2.0)
                for x in (-0.08 * s, 0.08 * s)
            ]
            return surfaces(
                fabric=fur,
                plastic_black=[
                    *eyes,
                    cushion((-0.03 * s, 0.22 * s, 0.68 * s, 0.03 * s, 0.27 * s, 0.73 * s), 2.0),
                ],
            )
        if self.form == "train":
            wagons, wheels = [], []
            for k in range(3):
                x = (k - 1) * 0.9 * s
                wagons.append(slabs((x - 0.36 * s, -0.18 * s, 0.12 * s, x + 0.36 * s, 0.18 * s, 0.24 * s)))
                wagons.append(
                    slabs(
                        (
                            x - 0.33 * s,
                            -0.16 * s,
                            0.24 * s,
                            x + rng.uniform(0.0, 0.33) * s,
                            0.16 * s,
                            rng.uniform(0.35, 0.6) * s,
                        )
                    )
                )
                for dx in (-0.22 * s, 0.22 * s):
                    v, t = lathe(((0.1 * s, -0.22 * s), (0.1 * s, 0.22 * s)), sides=14)
                    wheels.append((np.stack([v[:, 0] + x + dx, v[:, 2], v[:, 1] + 0.1 * s], -1), t[:, ::-1]))
            return surfaces(lacquer=wagons, plastic=wheels)
        blocks: list[list[Part]] = [[], []]
        z = 0.0
        for k in range(int(rng.integers(3, 8))):
            e = 0.5 * s * rng.uniform(0.6, 1.0)
            blocks[k % 2].append(
                turned(
                    slabs((-e / 2, -e / 2, 0.0, e / 2, e / 2, 0.8 * e)), rng.uniform(-30, 30), (0.0, 0.0, z)
                )
            )
            z += 0.8 * e
        return surfaces(lacquer=blocks[0], plastic=blocks[1])


@dataclass(frozen=True)
class Tool(IndoorShape):
    """A tool lying or standing about: hammer, pliers, drill, toolbox, spray can, tape."""

    form: str
    size: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            choose(rng, ["hammer", "drill", "toolbox", "can", "reel", "screwdriver"]), uniform(rng, 0.8, 1.2)
        )

    def parts(self) -> dict[str, Surface]:
        s = self.size
        if self.form == "hammer":
            return surfaces(
                wood=[rod(((0.0, -0.14 * s, 0.017), (0.0, 0.14 * s, 0.017)), 0.014)],
                metal=[slabs((-0.055 * s, 0.12 * s, 0.0, 0.055 * s, 0.15 * s, 0.034))],
            )
        if self.form == "screwdriver":
            return surfaces(
                plastic=[rod(((0.0, -0.1 * s, 0.014), (0.0, 0.0, 0.014)), 0.014)],
                chrome=[rod(((0.0, -0.01, 0.014), (0.0, 0.13 * s, 0.014)), 0.003, 6)],
            )
        if self.form == "drill":
            v, t = lathe(((0.03, -0.1), (0.035, -0.08), (0.035, 0.06), (0.022, 0.08)), sides=16)
            barrel = (np.stack([v[:, 2] * s, v[:, 0] * s, v[:, 1] * s + 0.19 * s], -1), t)
            bit = rod(((0.08 * s, 0.0, 0.19 * s), (0.2 * s, 0.0, 0.19 * s)), 0.004, 6)
            grip = slabs(
                (-0.035 * s, -0.02 * s, 0.05 * s, 0.01 * s, 0.02 * s, 0.17 * s),
                (-0.07 * s, -0.035 * s, 0.0, 0.05 * s, 0.035 * s, 0.055 * s),
            )
            return surfaces(plastic=[barrel], plastic_black=[grip], chrome=[bit])
        if self.form == "toolbox":
            handle = rod(((-0.1, 0.0, 0.2), (-0.08, 0.0, 0.25), (0.08, 0.0, 0.25), (0.1, 0.0, 0.2)), 0.01, 6)
            return surfaces(
                lacquer=[
                    slabs(
                        (-0.22 * s, -0.1 * s, 0.0, 0.22 * s, 0.1 * s, 0.15),
                        (-0.22 * s, -0.1 * s, 0.153, 0.22 * s, 0.1 * s, 0.2),
                    )
                ],
                chrome=[
                    slabs(
                        (-0.132, 0.1 * s, 0.13, -0.108, 0.1 * s + 0.004, 0.17),
                        (0.108, 0.1 * s, 0.13, 0.132, 0.1 * s + 0.004, 0.17),
                    )
                ],
                plastic_black=[handle],
            )
        if self.form == "reel":
            ring = lathe(
                (
                    (0.09 * s, 0.0),
                    (0.09 * s, 0.006),
                    (0.05 * s, 0.008),
                    (0.05 * s, 0.06),
                    (0.09 * s, 0.062),
                    (0.09 * s, 0.068),
                ),
                sides=24,
            )
            angle = np.linspace(0.0, 14 * np.pi, 160)
            path = np.stack(
                [0.06 * s * np.cos(angle), 0.06 * s * np.sin(angle), 0.012 + 0.044 * angle / angle[-1]], -1
            )
            v, t, _ = tube(path, np.full(len(path), 0.005), 6)
            return surfaces(plastic=[ring], plastic_cable=[(v, t)])
        return surfaces(
            print=[
                lathe(((0.032 * s, 0.0), (0.032 * s, 0.16))),
            ],
            plastic_white=[lathe(((0.03 * s, 0.16), (0.022 * s, 0.175), (0.022 * s, 0.2)))],
        )


@dataclass(frozen=True)
class PottedPlant(IndoorShape):
    """A plant in a pot: a rosette of long leaves, or a bushy one."""

    pot: float
    """Radius of the pot."""
    height: float
    """Of the leaves above the pot."""
    bushy: bool
    leaves: int
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        tall = chance(rng, 0.4)
        pot = uniform(rng, 0.13, 0.2) if tall else uniform(rng, 0.06, 0.1)
        return cls(pot, pot * uniform(rng, 3.0, 6.0), chance(rng, 0.45), integer(rng, 10, 26), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng, r, h = np.random.default_rng(self.seed), self.pot, self.height
        pot = lathe(
            (
                (0.7 * r, 0.0),
                (r, 1.7 * r),
                (1.08 * r, 1.72 * r),
                (1.08 * r, 1.95 * r),
                (0.95 * r, 1.95 * r),
                (0.92 * r, 1.75 * r),
            )
        )
        soil = lathe(((0.93 * r, 1.7 * r), (0.93 * r, 1.78 * r)))
        foot = np.array((0.0, 0.0, 1.75 * r))
        if self.bushy:
            centres = foot + rng.normal(0.0, 0.16, (6, 3)) * (h, h, 0.5 * h) + np.array((0.0, 0.0, 0.6 * h))
            leaves = leaf_cloud(rng, centres, np.full(6, 0.24 * h), 8 * self.leaves, 0.2 * h)
            stems = [rod((tuple(foot.tolist()), tuple(c.tolist())), 0.01 + 0.02 * r, 6) for c in centres]
            return surfaces(ceramic=[pot], soil=[soil], leaf=[leaves], wood_stem=stems)
        direction = around(rng, self.leaves, (45.0, 84.0))
        length = h * rng.uniform(0.75, 1.15, self.leaves)
        paths = arched(
            np.tile(foot, (self.leaves, 1)), direction, length, rng.uniform(0.1, 0.7, self.leaves), 9
        )
        share = np.linspace(0.0, 1.0, 9)[1:-1]
        widths = length[:, None] * (0.012 + 0.07 * np.sin(np.pi * share) ** 0.8)[None]
        leaves = strips(paths, width_directions(direction, rng), widths, 0.16)
        return surfaces(ceramic=[pot], soil=[soil], leaf=[leaves])

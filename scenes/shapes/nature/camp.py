"""What people put up in the open: palings, trellises, banners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from scenes.geometry.building import Part, joined, slab_triangles, struts, tube
from scenes.random_draws import choose, integer, new_seed, uniform
from scenes.shapes.anchored import PartedShape
from scenes.shapes.solids.organic import wave_noise

PALINGS = ("pales", "rails", "trellis", "lattice")
"""Upright pales on rails; rails between posts; canes tied square; laths crossed slantwise."""


@dataclass(frozen=True)
class Paling(PartedShape):
    """A fence about 2 long and up to 1 high, of many like bars: matching loses its way along it."""

    style: str
    bars: int
    height: float
    thickness: float
    """Radius of a bar."""
    crooked: float
    """How far bars stray, relative to their spacing."""
    seed: int

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            style=choose(rng, PALINGS),
            bars=integer(rng, 9, 22),
            height=uniform(rng, 0.5, 1.0),
            thickness=uniform(rng, 0.012, 0.03),
            crooked=uniform(rng, 0.0, 0.2),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        high, step = self.height, 2.0 / self.bars
        at = -1.0 + step * (np.arange(self.bars) + 0.5)
        across = np.linspace(0.08, 0.94, max(3, round(high / step))) * high
        posts = [((x, 0.03, -0.1), (x, 0.03, high), 1.6) for x in (-1.0, 0.0, 1.0)]
        if self.style == "pales":
            bars = [((x, 0.0, -0.05), (x, 0.0, high * rng.uniform(0.92, 1.05)), 1.0) for x in at]
            bars += [((-1.0, 0.035, z * high), (1.0, 0.035, z * high), 0.7) for z in (0.25, 0.78)]
        elif self.style == "rails":
            bars = [((-1.0, 0.0, z), (1.0, 0.0, z), 1.0) for z in across] + posts
        elif self.style == "trellis":
            bars = [((x, 0.0, -0.05), (x, 0.0, high), 0.7) for x in at]
            bars += [((-1.0, 0.03, z), (1.0, 0.03, z), 0.7) for z in across] + posts
        else:
            bars = [
                *posts,
                ((-1.0, 0.02, 0.04), (1.0, 0.02, 0.04), 0.9),
                ((-1.0, 0.02, high), (1.0, 0.02, high), 0.9),
            ]
            for x in np.arange(-1.0 - high, 1.0, 1.4 * step):
                # From the lower rail up to the upper one, as far as the panel reaches.
                low, end = max(x, -1.0), min(x + high, 1.0)
                if end > low + 0.02:
                    bars.append(((low, 0.0, low - x), (end, 0.0, end - x), 0.55))
                    bars.append(((-low, 0.02, low - x), (-end, 0.02, end - x), 0.55))
        start, stop = (np.array([bar[k] for bar in bars], np.float64) for k in (0, 1))
        stray = self.crooked * step * rng.uniform(-1.0, 1.0, (len(bars), 2))
        start[:, 0] += stray[:, 0]
        stop[:, 0] += stray[:, 1]
        radius = self.thickness * np.array([bar[2] for bar in bars]) * rng.uniform(0.85, 1.15, len(bars))
        return {"wood": struts(start, stop, radius, radius * rng.uniform(0.8, 1.0, len(bars)), 6)}


@dataclass(frozen=True)
class Banner(PartedShape):
    """A cloth that hangs in folds from a bar across a pole."""

    width: float
    """Of the cloth, relative to the pole's height."""
    drop: float
    """Length of the cloth."""
    folds: float
    """Depth of the folds relative to the width."""
    waves: float
    """Folds across the cloth."""
    seed: int

    popularity: ClassVar[float] = 0.0
    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            width=uniform(rng, 0.25, 0.6),
            drop=uniform(rng, 0.4, 0.85),
            folds=uniform(rng, 0.03, 0.09),
            waves=uniform(rng, 1.5, 5.0),
            seed=new_seed(rng),
        )

    def parts(self) -> dict[str, Part]:
        rng = np.random.default_rng(self.seed)
        u, v = np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(0.0, 1.0, 25))
        flat = np.stack([4.0 * self.waves * u, 1.2 * v], -1).reshape(-1, 2)
        deep = (
            self.folds * self.width * (0.25 + 0.75 * v) * wave_noise(rng, flat, 1.0, 1.0, 14).reshape(u.shape)
        )
        sag = 0.04 * v * np.sin(np.pi * (u + 0.5))
        cloth = np.stack([self.width * u * (1 - 0.08 * v), deep - 0.03, 0.96 - self.drop * v - sag], -1)
        behind = np.add(cloth, (0.0, 0.006, 0.0))
        sheet = np.concatenate([behind.reshape(-1, 3), cloth.reshape(-1, 3)]), slab_triangles(25, 41)
        pole = tube(np.array([(0.0, 0.0, -0.1), (0.0, 0.0, 0.5), (0.0, 0.0, 1.04)]), np.full(3, 0.016), 8)[:2]
        half = 0.5 * self.width + 0.03
        bar = tube(
            np.array([(-half, -0.03, 0.965), (0.0, -0.03, 0.965), (half, -0.03, 0.965)]), np.full(3, 0.01), 7
        )[:2]
        return {"cloth": sheet, "wood": joined(pole, bar)}

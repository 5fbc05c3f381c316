"""Plants at a fixed scale, for streets: leaves, lawns, bark."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import (
    Palette,
    colorize,
    finish,
    shade,
    smooth_step,
    spectral_noise,
    to_unit,
    unit_grid,
)
from scenes.random_draws import chance, integer, new_seed, uniform
from scenes.spec import Texture
from scenes.textures.cells import cellular_noise


@dataclass(frozen=True)
class Foliage(Texture):
    """A dense cover of light and dark leaves."""

    size: int
    seed: int
    palette: Palette
    """Dark to light."""
    leaves: int
    """Leaves along one side."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        hue = uniform(rng, 112.0, 142.0) if chance(rng, 0.82) else uniform(rng, 45.0, 100.0)
        chroma, base = uniform(rng, 0.07, 0.13), uniform(rng, 0.4, 0.52)
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=tuple(
                shade(base + 0.16 * k, chroma * (0.7 + 0.15 * k), hue - 6 * k) for k in range(-1, 3)
            ),
            leaves=integer(rng, 14, 26),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        nearest, first, second = cellular_noise(rng, x, y, self.leaves, 1.0)
        tone = rng.uniform(0.0, 1.0, self.leaves**2).astype(np.float32)[nearest]
        clumps = np.float32(0.18) * spectral_noise(rng, self.size, 1.2, 2)
        edge = smooth_step(second - first, 0.08, 0.2)
        light = np.float32(0.55) + np.float32(0.5) * edge - np.float32(0.2) * first
        return finish(
            colorize(tone * np.float32(0.8) + clumps + np.float32(0.1), self.palette) * light, rng, 0.08
        )


@dataclass(frozen=True)
class Grass(Texture):
    """Lawn or meadow, with dry patches."""

    size: int
    seed: int
    palette: Palette

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        hue = uniform(rng, 100.0, 135.0)
        base, chroma = uniform(rng, 0.38, 0.52), uniform(rng, 0.05, 0.11)
        dry = shade(base + 0.14, 0.05, 90.0)
        green = [shade(base + step, chroma, hue) for step in (-0.12, 0.0, 0.08)]
        return cls(size, new_seed(rng), (*green, dry))

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        blades = spectral_noise(rng, self.size, 0.5, 8, stretch=(1.0, 2.0))
        tufts = spectral_noise(rng, self.size, 1.2, 1)
        return finish(
            colorize(to_unit(np.float32(0.6) * blades + np.float32(0.5) * tufts), self.palette), rng, 0.1
        )


@dataclass(frozen=True)
class Bark(Texture):
    """Bark with ridges along the stem."""

    size: int
    seed: int
    palette: Palette

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        base, hue = uniform(rng, 0.32, 0.55), uniform(rng, 50.0, 80.0)
        return cls(size, new_seed(rng), tuple(shade(base + step, 0.03, hue) for step in (-0.16, 0.0, 0.12)))

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        ridges = spectral_noise(rng, self.size, 0.9, 5, stretch=(1.0, 4.0))
        return finish(colorize(to_unit(ridges), self.palette), rng, 0.1)

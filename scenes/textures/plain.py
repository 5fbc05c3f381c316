"""Pictures with almost no pattern."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import (
    Palette,
    Srgb,
    colorize,
    finish,
    fraction,
    paint,
    sample_palette,
    spectral_noise,
    to_unit,
    unit_grid,
)
from scenes.random_draws import new_seed, uniform
from scenes.spec import Texture


@dataclass(frozen=True)
class SolidColor(Texture):
    """One colour everywhere."""

    srgb: tuple[int, int, int]
    """0..255."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:  # noqa: ARG003
        r, g, b = (int(value) for value in rng.integers(0, 256, 3))
        return cls(srgb=(r, g, b))

    def image(self) -> NDArray[np.uint8]:
        return np.full((4, 4, 3), self.srgb, np.uint8)


@dataclass(frozen=True)
class NearTextureless(Texture):
    """One colour with faint clouds and the faintest grain: walls, paint, plastic."""

    size: int
    seed: int
    color: Srgb
    clouds: float
    """Standard deviation of the slow variation relative to the colour."""
    grain: float

    popularity: ClassVar[float] = 0.5

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            color=sample_palette(rng, 3)[1],
            clouds=uniform(rng, 0.02, 0.08),
            grain=uniform(rng, 0.005, 0.025),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        clouds = 1 + np.float32(self.clouds) * spectral_noise(rng, self.size, 1.5)
        return finish(clouds * paint(self.color), rng, self.grain)


@dataclass(frozen=True)
class Gradient(Texture):
    """Soft bands of colour running one way and back, a little wavy."""

    size: int
    seed: int
    palette: Palette
    cycles: tuple[int, int]
    """Periods along x and y."""
    waviness: float
    """Amplitude of the waves in periods."""
    grain: float

    popularity: ClassVar[float] = 0.6

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, int(rng.integers(3, 6))),
            cycles=(int(rng.integers(0, 3)), int(rng.integers(1, 3))),
            waviness=uniform(rng, 0.0, 0.25),
            grain=uniform(rng, 0.04, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        phase = self.cycles[0] * x + self.cycles[1] * y
        phase = phase + np.float32(self.waviness) * spectral_noise(rng, self.size, 2.0)
        ramp = np.abs(2 * (fraction(phase)) - 1)
        detail = to_unit(spectral_noise(rng, self.size, 0.8, 4)) - np.float32(0.5)
        picture = colorize(ramp, self.palette) * (1 + np.float32(0.25) * detail)
        return finish(picture, rng, self.grain)

"""Filtered noise: clouds, stone, rust, labyrinths, marble, wood."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import (
    Palette,
    Srgb,
    colorize,
    finish,
    fraction,
    mix,
    paint,
    sample_palette,
    smooth_step,
    spectral_noise,
    to_unit,
    unit_grid,
)
from scenes.random_draws import choose, integer, log_uniform, new_seed, uniform
from scenes.spec import OMIT_DEFAULT, Texture


@dataclass(frozen=True)
class FractalNoise(Texture):
    """1/f noise coloured by a palette: clouds, stone, soil, distant foliage."""

    size: int
    seed: int
    palette: Palette
    slope: float
    """Exponent of the amplitude spectrum: 0.7 gritty, 1.5 cloudy."""
    low_cycles: float
    """Coarsest structures per picture."""
    ridges: bool
    """Whether the absolute value of the noise is taken, which makes veins and ridges."""
    grain: float

    popularity: ClassVar[float] = 1.5

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, integer(rng, 3, 6)),
            slope=uniform(rng, 0.7, 1.5),
            low_cycles=log_uniform(rng, 1.0, 12.0),
            ridges=bool(rng.random() < 0.3),
            grain=uniform(rng, 0.03, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        noise = spectral_noise(rng, self.size, self.slope, self.low_cycles)
        value = 1 - np.tanh(np.abs(noise)) if self.ridges else to_unit(noise)
        return finish(colorize(value, self.palette), rng, self.grain)


@dataclass(frozen=True)
class NaturalSpectrum(Texture):
    """Three correlated 1/f fields as colour channels: the second-order statistics of photographs."""

    size: int
    seed: int
    mean: Srgb
    tint: Srgb
    """Colour towards which the second, weaker field leans."""
    contrast: float
    """Standard deviation of the brightness relative to its mean."""
    slope: float
    """Exponent of the amplitude spectrum; about 1 in photographs."""
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, 3)
        return cls(
            size=size,
            seed=new_seed(rng),
            mean=palette[0],
            tint=palette[1],
            contrast=uniform(rng, 0.25, 0.6),
            slope=uniform(rng, 0.8, 1.3),
            grain=uniform(rng, 0.03, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        light = np.exp(np.float32(self.contrast) * spectral_noise(rng, self.size, self.slope, 2))
        hue = to_unit(2 * spectral_noise(rng, self.size, self.slope + 0.3, 2))
        picture = mix(paint(self.mean), paint(self.tint), hue) * light
        return finish(picture, rng, self.grain)


@dataclass(frozen=True)
class Labyrinth(Texture):
    """Spots and labyrinths like those of reaction-diffusion systems: thresholded noise of one wavelength.

    The early growth of such a system amplifies noise in a narrow band of wavelengths (A. Turing, "The chemical
    basis of morphogenesis", 1952).
    """

    size: int
    seed: int
    palette: Palette
    """Two colours of the ground, one of the pattern."""
    cycles: float
    """Wavelengths per picture."""
    balance: float
    """-1..1: from holes in the pattern over a labyrinth to single spots."""
    stretch: tuple[float, float]
    """Elongation along x and y."""
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        stretch = (1.0, 1.0) if rng.random() < 0.6 else (uniform(rng, 1.0, 3.0), 1.0)
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, 3),
            cycles=log_uniform(rng, 6.0, 28.0),
            balance=uniform(rng, -0.9, 0.9),
            stretch=stretch,
            grain=uniform(rng, 0.05, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        band = spectral_noise(rng, self.size, 0.0, self.cycles * 0.8, self.cycles * 1.2, self.stretch)
        band = band + np.float32(0.2) * spectral_noise(rng, self.size, 1.0, self.cycles)
        pattern = smooth_step(band, self.balance, 0.35)
        shades = spectral_noise(rng, self.size, 1.0, 2)
        ground = colorize(to_unit(shades), self.palette[:2])
        ink = paint(self.palette[2]) * (1 + np.float32(0.15) * shades)
        return finish(mix(ground, ink, pattern), rng, self.grain)


@dataclass(frozen=True)
class Marble(Texture):
    """Layers bent by turbulence: marble, agate, water, sand ripples."""

    size: int
    seed: int
    palette: Palette
    cycles: tuple[int, int]
    """Layers per picture along x and y."""
    turbulence: float
    """Amplitude of the bending in layers."""
    slope: float
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, integer(rng, 2, 5)),
            cycles=(integer(rng, -8, 8), integer(rng, 1, 10)),
            turbulence=uniform(rng, 0.1, 1.0),
            slope=uniform(rng, 1.2, 2.0),
            grain=uniform(rng, 0.03, 0.1),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        bend = np.float32(self.turbulence) * spectral_noise(rng, self.size, self.slope, 1)
        layers = 0.5 + 0.5 * np.sin(np.float32(2 * np.pi) * (self.cycles[0] * x + self.cycles[1] * y + bend))
        grit = np.float32(0.08) * spectral_noise(rng, self.size, 0.6, 6)
        return finish(colorize(layers + grit, self.palette), rng, self.grain)


@dataclass(frozen=True)
class WoodPlanks(Texture):
    """Boards side by side, each cut from elsewhere in the tree: year rings, pores, dark joints."""

    size: int
    seed: int
    palette: Palette
    """Early wood, late wood."""
    planks: int
    """Boards across the picture."""
    rings: float
    """Year rings across a board."""
    grain: float
    joint: float = field(default=0.6, metadata=OMIT_DEFAULT)
    """Darkness of the joints between boards, 0..1."""

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, 2),
            planks=choose(rng, [1, 2, 3, 4, 6]),
            rings=uniform(rng, 2.0, 7.0),
            grain=uniform(rng, 0.04, 0.1),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        across = unit_grid(self.size)[0] * self.planks
        board = across.astype(np.int32) % self.planks
        # Each board shows its own part of the noise: rows shifted by a board's own offset.
        offset = rng.integers(0, self.size, self.planks)[board[0]]
        rows = (np.arange(self.size)[:, None] + offset) % self.size
        columns = np.arange(self.size)[None, :]
        bend = spectral_noise(rng, self.size, 1.8, 1, stretch=(1.0, 4.0))[rows, columns]
        pores = spectral_noise(rng, self.size, 0.4, 8, stretch=(1.0, 16.0))[rows, columns]
        ring = (across - board) * np.float32(self.rings) + np.float32(0.9) * bend
        value = fraction(ring) ** 2 + np.float32(0.12) * pores
        tone = 1 + np.float32(0.15) * rng.standard_normal(self.planks).astype(np.float32)[board]
        edge = np.minimum(fraction(across), 1 - fraction(across))
        joint = 1 - np.float32(self.joint) * (1 - smooth_step(edge, 0.012 * self.planks, 0.012 * self.planks))
        picture = colorize(value, self.palette) * (tone * joint)
        return finish(picture, rng, self.grain)

"""Pictures of things in rooms: the spines of books, parquet."""

from __future__ import annotations

import itertools
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
    mix,
    oklch_to_srgb,
    paint,
    sample_palette,
    smooth_step,
    spectral_noise,
    unit_grid,
)
from scenes.random_draws import choose, integer, new_seed, uniform
from scenes.spec import Texture


@dataclass(frozen=True)
class BookSpines(Texture):
    """A square of cells, each the spine of another book: its colour, bands, a title and a publisher's mark."""

    size: int
    seed: int
    cells: int
    """Spines along one side."""
    vivid: float
    """Chroma of the most colourful spine, 0..0.3."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(size=size, seed=new_seed(rng), cells=6, vivid=uniform(rng, 0.05, 0.2))

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        edges = np.round(np.linspace(0, self.size, self.cells + 1)).astype(int)
        picture = np.empty((self.size, self.size, 3), np.float32)
        for low, high in itertools.pairwise(edges):
            for left, right in itertools.pairwise(edges):
                picture[low:high, left:right] = self._spine(rng, high - low, right - left)
        return finish(np.ascontiguousarray(picture.transpose(2, 0, 1)), rng, 0.03)

    def _spine(self, rng: np.random.Generator, height: int, width: int) -> NDArray[np.float32]:
        lightness = rng.uniform(0.2, 0.95)
        light = np.array(
            [
                lightness,
                rng.uniform(0.1, 0.3) if lightness > 0.6 else rng.uniform(0.8, 0.96),
                rng.uniform(0.3, 0.8),
            ]
        )
        chroma = self.vivid * rng.random(3) ** 1.5
        colors = oklch_to_srgb(light, chroma, rng.uniform(0.0, 2 * np.pi, 3)).astype(np.float32)
        spine = np.tile(colors[0], (height, width, 1))
        for _ in range(int(rng.integers(0, 4))):
            at, thick = int(rng.integers(0, height)), int(rng.integers(1, max(2, height // 8)))
            spine[at : at + thick] = colors[int(rng.integers(1, 3))]
        # A title that runs along the spine, as rows of short strokes.
        low, high = int(height * rng.uniform(0.1, 0.3)), int(height * rng.uniform(0.55, 0.9))
        half = max(1, int(width * rng.uniform(0.12, 0.25)))
        row = low
        while row < high:
            stroke = int(rng.integers(1, 4))
            if rng.random() < 0.7:
                left = width // 2 - half + int(rng.integers(0, half))
                spine[row : row + stroke, left : left + half] = colors[1]
            row += stroke + int(rng.integers(1, 3))
        return spine


@dataclass(frozen=True)
class GlazedTiles(Texture):
    """Equal tiles in straight joints, each of a slightly different shade: bathrooms, kitchens, ceilings."""

    size: int
    seed: int
    palette: Palette
    joint: Srgb
    rows: int
    """Even where there is a bond, so that it repeats."""
    columns: int
    bond: float
    """Shift of every other row in tiles: 0.5 running bond, 0 stacked."""
    joint_width: float
    """Relative to a tile's height."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, 3)
        rows = 2 * integer(rng, 2, 6)
        return cls(size, new_seed(rng), palette[1:], palette[0], rows, rows, 0.0, uniform(rng, 0.02, 0.06))

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        v = y * np.float32(self.rows)
        row = np.floor(v).astype(np.int32)
        u = x * np.float32(self.columns) + np.float32(self.bond) * (row % 2)
        column = np.floor(u).astype(np.int32) % self.columns
        tone = rng.random((self.rows, self.columns), np.float32)[row, column]
        across = np.minimum(fraction(u), 1 - fraction(u)) * np.float32(self.rows / self.columns)
        edge = np.minimum(across, np.minimum(fraction(v), 1 - fraction(v))).astype(np.float32)
        face = smooth_step(edge, self.joint_width / 2, 1.5 * self.rows / self.size)
        return finish(mix(paint(self.joint), colorize(tone, self.palette), face), rng, 0.004)


@dataclass(frozen=True)
class Parquet(Texture):
    """Wooden blocks: in staggered courses, in herringbone or in squares of fingers."""

    size: int
    seed: int
    palette: Palette
    """Dark to light."""
    pattern: str
    """courses, herringbone or squares."""
    blocks: int
    """Blocks across the picture; a multiple of 4."""
    joint: float
    """Darkness of the joints, 0..1."""
    grain: float

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, 3),
            pattern=choose(rng, ["courses", "herringbone", "squares"], [0.6, 0.25, 0.15]),
            blocks=choose(rng, [8, 12, 16]),
            joint=uniform(rng, 0.15, 0.6),
            grain=uniform(rng, 0.02, 0.06),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        n = np.float32(self.blocks)
        u, v = x * n, y * n
        if self.pattern == "courses":
            row = np.floor(u).astype(np.int32)
            shift = rng.uniform(0.0, 1.0, self.blocks).astype(np.float32)[row % self.blocks]
            along = v * np.float32(2 / self.blocks) + shift
            number = row * 7 + np.floor(along).astype(np.int32) % 2 * 3
            across, along, upright = (
                fraction(u),
                fraction(along) * np.float32(self.blocks / 2),
                np.ones_like(row, bool),
            )
        elif self.pattern == "squares":
            column, row = np.floor(u / 4).astype(np.int32), np.floor(v / 4).astype(np.int32)
            upright = (column + row) % 2 == 0
            finger = np.where(upright, u, v)
            across, along = fraction(finger), np.where(upright, v, u) % 4
            number = column * 31 + row * 17 + np.floor(finger).astype(np.int32)
        else:
            # Steps of one block: along each row the pattern of upright and lying blocks repeats after eight.
            column, row = np.floor(u).astype(np.int32), np.floor(v).astype(np.int32)
            phase = (column + row) % 8
            upright = phase < 4
            across = np.where(upright, fraction(u), fraction(v))
            step = np.where(upright, phase, phase - 4)
            along = np.where(upright, 3 - step + fraction(v), step + fraction(u))
            number = np.where(
                upright, column * 13 + (row + step) // 4 * 7, row * 11 + (column - step) // 4 * 5 + 3
            )
        tone = rng.uniform(0.0, 1.0, 211).astype(np.float32)[np.abs(number) % 211]
        pores = spectral_noise(rng, self.size, 0.5, 6, stretch=(1.0, 10.0))
        streaks = np.where(upright, pores, pores.T)
        value = 0.2 + 0.55 * tone + np.float32(0.12) * streaks
        edge = (
            np.minimum(np.minimum(across, 1 - across), np.minimum(along, 4 - along))
            if self.pattern != "courses"
            else np.minimum(across, 1 - across)
        )
        if self.pattern == "courses":
            edge = np.minimum(edge, np.minimum(along, self.blocks / 2 - along))
        soft = 1.5 * self.blocks / self.size
        shadow = 1 - np.float32(self.joint) * (1 - smooth_step(edge.astype(np.float32), 0.5 * soft, soft))
        return finish(colorize(value.astype(np.float32), self.palette) * shadow, rng, self.grain)

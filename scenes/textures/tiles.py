"""Regular patterns: bricks, checkers, stripes, plaid, dots, weave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import (
    Field,
    Palette,
    Srgb,
    colorize,
    finish,
    flat_colors,
    fraction,
    mix,
    paint,
    sample_palette,
    smooth_step,
    spectral_noise,
    to_unit,
    unit_grid,
)
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.spec import Texture


def _wear(rng: np.random.Generator, size: int, strength: float) -> Field:
    """(H, W) slow and fine variations of brightness about 1, as use and weather leave them."""
    noise = spectral_noise(rng, size, 1.0, 1)
    return np.clip(1 + np.float32(strength) * noise, 0.2, 1.8)


@dataclass(frozen=True)
class Bricks(Texture):
    """Courses of bricks or tiles of different shades in mortar."""

    size: int
    seed: int
    palette: Palette
    mortar: Srgb
    rows: int
    """Courses per picture; even, so that the bond repeats."""
    columns: int
    bond: float
    """Shift of every other course in bricks: 0.5 running bond, 0 stacked tiles."""
    joint: float
    """Mortar width relative to a course's height."""
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, integer(rng, 3, 4))
        rows = 2 * integer(rng, 2, 10)
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette[1:],
            mortar=palette[0],
            rows=rows,
            columns=max(1, round(rows / choose(rng, [1.0, 2.0, 3.0]))),
            bond=0.5 if chance(rng, 0.7) else 0.0,
            joint=uniform(rng, 0.05, 0.18),
            grain=uniform(rng, 0.05, 0.15),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        wobble = np.float32(0.04 / self.rows) * spectral_noise(rng, self.size, 1.2, self.rows)
        v = (y + wobble) * self.rows
        row = np.floor(v).astype(np.int32) % self.rows
        u = (x + wobble) * self.columns + np.float32(self.bond) * (row % 2)
        column = np.floor(u).astype(np.int32) % self.columns
        tone = rng.uniform(0.0, 1.0, (self.rows, self.columns)).astype(np.float32)[row, column]
        tone = tone + np.float32(0.1) * spectral_noise(rng, self.size, 0.8, 4)
        across = np.minimum(fraction(u), 1 - fraction(u)) * np.float32(self.rows / self.columns)
        edge = np.minimum(across, np.minimum(fraction(v), 1 - fraction(v)))
        face = smooth_step(edge, self.joint / 2, self.joint * 0.5)
        picture = mix(paint(self.mortar), colorize(tone, self.palette), face)
        return finish(picture * _wear(rng, self.size, 0.12), rng, self.grain)


@dataclass(frozen=True)
class Checkers(Texture):
    """Squares of two or more colours in turn, a little worn."""

    size: int
    seed: int
    palette: Palette
    squares: int
    """Along one side; a multiple of the number of colours."""
    diagonal: bool
    """Whether the squares stand on their corners."""
    wear: float
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        colors = choose(rng, [2, 2, 2, 3, 4])
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, colors),
            squares=colors * integer(rng, 2, 6),
            diagonal=chance(rng, 0.3),
            wear=uniform(rng, 0.05, 0.25),
            grain=uniform(rng, 0.04, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        x, y = (x + y, x - y) if self.diagonal else (x, y)
        count = self.squares
        index = (np.floor(x * count) + np.floor(y * count)).astype(np.int32) % len(self.palette)
        return finish(flat_colors(index, self.palette) * _wear(rng, self.size, self.wear), rng, self.grain)


@dataclass(frozen=True)
class Stripes(Texture):
    """Stripes of varied width and colour in one direction, straight or wavy; narrow ones make gratings."""

    size: int
    seed: int
    palette: Palette
    cycles: tuple[int, int]
    """Repetitions of the whole set of stripes along x and y."""
    widths: tuple[float, ...]
    """Relative widths, one a stripe."""
    waviness: float
    """Amplitude of the waves in repetitions."""
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        count = integer(rng, 2, 7)
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, min(count, 4)),
            cycles=choose(
                rng, [(1, 0), (0, 1), (1, 1), (2, -1), (1, 3), (5, 0), (0, 4), (3, 2), (9, 0), (0, 12)]
            ),
            widths=tuple(float(width) for width in rng.uniform(0.2, 1.0, count)),
            waviness=uniform(rng, 0.05, 0.4) if chance(rng, 0.35) else 0.0,
            grain=uniform(rng, 0.05, 0.14),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        bend = np.float32(self.waviness) * spectral_noise(rng, self.size, 2.0, 1)
        phase = fraction(self.cycles[0] * x + self.cycles[1] * y + bend)
        ends = np.cumsum(self.widths) / np.sum(self.widths)
        stripe = np.searchsorted(ends[:-1].astype(np.float32), phase.ravel(), side="right").reshape(
            phase.shape
        )
        picture = flat_colors(stripe % len(self.palette), self.palette)
        return finish(picture * _wear(rng, self.size, 0.12), rng, self.grain)


@dataclass(frozen=True)
class Plaid(Texture):
    """Two crossing sets of stripes, woven in twill: tartan, tea towels."""

    size: int
    seed: int
    palette: Palette
    bands: tuple[int, ...]
    """Colour of each of the equal bands that repeat along both directions."""
    repeats: int
    thread: int
    """Width of a thread in pixels."""
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, integer(rng, 2, 4))
        runs = [
            [int(rng.integers(len(palette)))] * int(rng.integers(1, 7)) for _ in range(integer(rng, 3, 7))
        ]
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            bands=tuple(color for run in runs for color in run),
            repeats=integer(rng, 1, 4),
            thread=choose(rng, [1, 2, 4]),
            grain=uniform(rng, 0.04, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        count = len(self.bands)
        place = (np.arange(self.size) * count * self.repeats // self.size) % count
        thread = np.array(self.bands)[place]
        pixel = np.arange(self.size) // self.thread
        # Two over, two under, one thread further in each row.
        over = ((pixel[:, None] + pixel[None, :]) % 4 < 2).astype(np.float32)
        weft, warp = flat_colors(thread[:, None], self.palette), flat_colors(thread[None, :], self.palette)
        picture = mix(warp, weft, np.float32(0.2) + np.float32(0.6) * over)
        return finish(picture * _wear(rng, self.size, 0.08), rng, self.grain)


@dataclass(frozen=True)
class Dots(Texture):
    """Discs or rings on a square or staggered grid: polka dots, perforations, studs."""

    size: int
    seed: int
    palette: Palette
    """Ground first, then the dots' colours."""
    columns: int
    """Even, so that staggered rows repeat."""
    radius: float
    """In columns, below 0.5."""
    ring: float
    """Radius of a hole in each dot relative to the dot; 0 for none."""
    staggered: bool
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, integer(rng, 2, 4)),
            columns=2 * integer(rng, 2, 10),
            radius=uniform(rng, 0.18, 0.46),
            ring=uniform(rng, 0.3, 0.8) if chance(rng, 0.25) else 0.0,
            staggered=chance(rng, 0.5),
            grain=uniform(rng, 0.05, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        v = y * self.columns
        row = np.floor(v).astype(np.int32)
        u = x * self.columns + (np.float32(0.5) * (row % 2) if self.staggered else np.float32(0))
        column = np.floor(u).astype(np.int32) % self.columns
        reach = np.hypot(fraction(u) - np.float32(0.5), fraction(v) - np.float32(0.5))
        soft = 1.5 * self.columns / self.size
        cover = 1 - smooth_step(reach, self.radius, soft)
        if self.ring > 0:
            cover = cover * smooth_step(reach, self.radius * self.ring, soft)
        kinds = rng.integers(1, len(self.palette), (self.columns, self.columns))
        dots = flat_colors(kinds[row % self.columns, column], self.palette)
        ground = paint(self.palette[0]) * _wear(rng, self.size, 0.1)
        return finish(mix(ground, dots, cover), rng, self.grain)


@dataclass(frozen=True)
class Weave(Texture):
    """Over-and-under bands with rounded shading: baskets, canvas, chain mail."""

    size: int
    seed: int
    palette: Palette
    """Warp and weft."""
    strands: int
    """Bands along one side; even."""
    gap: float
    """Open share between the bands."""
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, 2),
            strands=2 * integer(rng, 4, 20),
            gap=uniform(rng, 0.05, 0.35),
            grain=uniform(rng, 0.05, 0.15),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        u, v = x * self.strands, y * self.strands
        weft_on_top = (np.floor(u) + np.floor(v)).astype(np.int32) % 2 == 0
        along = np.where(weft_on_top, fraction(u), fraction(v)) - np.float32(0.5)
        across = np.abs(np.where(weft_on_top, fraction(v), fraction(u)) - np.float32(0.5))
        height = np.cos(np.pi * along) * (1 - (2 * across) ** 2 * np.float32(0.6))
        band = 1 - smooth_step(across, 0.5 - self.gap / 2, 0.12)
        shading = to_unit(spectral_noise(rng, self.size, 0.8, 2))
        color = flat_colors(weft_on_top.astype(np.int32), self.palette)
        shade = np.float32(0.3) + np.float32(0.9) * np.sqrt(np.abs(height)) * band
        light = shade * (np.float32(0.75) + np.float32(0.5) * shading)
        return finish(color * light, rng, self.grain)

"""Houses at a fixed scale, for streets: plaster, windows, roofs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import (
    Field,
    Palette,
    Picture,
    Srgb,
    colorize,
    finish,
    fraction,
    mix,
    paint,
    shade,
    smooth_step,
    spectral_noise,
    unit_grid,
)
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.spec import Texture


@dataclass(frozen=True)
class Plaster(Texture):
    """Plaster, painted walls, concrete: one colour with clouds and streaks of rain."""

    size: int
    seed: int
    color: Srgb
    clouds: float
    streaks: float
    grain: float

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        hue = choose(
            rng, [75.0, 85.0, 95.0, 50.0, 30.0, 150.0, 240.0], [0.25, 0.2, 0.15, 0.15, 0.1, 0.05, 0.1]
        )
        return cls(
            size=size,
            seed=new_seed(rng),
            color=shade(uniform(rng, 0.55, 0.93), uniform(rng, 0.0, 0.075), hue + uniform(rng, -10.0, 10.0)),
            clouds=uniform(rng, 0.03, 0.09),
            streaks=uniform(rng, 0.0, 0.1),
            grain=uniform(rng, 0.04, 0.1),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        clouds = np.float32(self.clouds) * spectral_noise(rng, self.size, 1.2, 1)
        streaks = np.float32(self.streaks) * spectral_noise(rng, self.size, 0.9, 3, stretch=(1.0, 9.0))
        return finish(paint(self.color) * np.clip(1 + clouds + streaks, 0.3, 1.6), rng, self.grain)


@dataclass(frozen=True)
class WindowPanes(Texture):
    """Windows as seen in a wall's openings: frames, dark glass, curtains, blinds, lit rooms.

    The picture is a grid of cells, one for each bay of each floor; an opening shows the middle of its cell.
    """

    size: int
    seed: int
    opening: tuple[float, float]
    """Width and height of the visible part, as shares of a cell."""
    sill: float
    """Height of its lower edge, as a share of the cell."""
    frame: Srgb
    glass: Srgb
    lit: float
    """Share of rooms with the light on."""
    curtains: float
    """Share of windows with curtains or blinds."""

    popularity: ClassVar[float] = 0.0

    CELLS: ClassVar[int] = 4
    """Cells along one side."""

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        frame = (
            shade(0.95, 0.01, 90.0)
            if chance(rng, 0.6)
            else shade(uniform(rng, 0.2, 0.6), 0.05, uniform(rng, 30.0, 260.0))
        )
        return cls(
            size=size,
            seed=new_seed(rng),
            opening=(uniform(rng, 0.3, 0.7), uniform(rng, 0.4, 0.7)),
            sill=uniform(rng, 0.2, 0.3),
            frame=frame,
            glass=shade(uniform(rng, 0.2, 0.38), 0.025, uniform(rng, 200.0, 260.0)),
            lit=0.0,
            curtains=uniform(rng, 0.1, 0.7),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        cells = self.CELLS
        u, v = x * cells, (1 - y) * cells
        column, row = (grid.astype(np.int32) % cells for grid in (u, v))
        # 0..1 within the opening, upwards.
        a = (fraction(u) - np.float32(0.5)) / np.float32(self.opening[0]) + np.float32(0.5)
        b = (fraction(v) - np.float32(self.sill)) / np.float32(self.opening[1])
        room = rng.uniform(0.0, 1.0, (5, cells, cells)).astype(np.float32)[:, row, column]
        depth = (
            np.float32(0.6) + np.float32(0.6) * b + np.float32(0.25) * spectral_noise(rng, self.size, 1.3, 3)
        )
        picture = paint(self.glass) * depth
        picture = mix(
            picture,
            np.array((255, 205, 130), np.float32)[:, None, None] * (1 - np.float32(0.35) * b),
            (room[0] < self.lit).astype(np.float32) * np.float32(0.85),
        )
        picture = self._covered(picture, a, b, room)
        edge = np.minimum(np.minimum(a, 1 - a), np.minimum(b, 1 - b))
        frame = 1 - smooth_step(edge, 0.06, 0.02)
        picture = mix(picture, paint(self.frame), frame)
        if self.lit > 0:
            # The whole picture glows by night: all but the lit rooms must be dark.
            picture = picture * np.where(room[0] < self.lit, np.float32(1), np.float32(0.35))
        return finish(picture, rng, 0.04)

    def _covered(self, picture: Picture, a: Field, b: Field, room: Field) -> Picture:
        """The picture with curtains at the sides, or a blind lowered part of the way."""
        dressed = room[1] < self.curtains
        tone = colorize(room[3], ((238, 234, 222), (225, 214, 190), (190, 190, 196), (150, 120, 100)))
        folds = np.float32(0.85) + np.float32(0.15) * np.sin(a * np.float32(60))
        drawn = np.float32(0.12) + np.float32(0.3) * room[4]
        sides = (np.minimum(a, 1 - a) < drawn) & (room[2] < 0.6)
        slats = np.float32(0.85) + np.float32(0.15) * np.sin(b * np.float32(70))
        blind = (b > room[4]) & (room[2] >= 0.6)
        picture = mix(picture, tone * folds, (dressed & sides).astype(np.float32) * np.float32(0.9))
        return mix(picture, tone * slats, (dressed & blind).astype(np.float32) * np.float32(0.95))


@dataclass(frozen=True)
class RoofTiles(Texture):
    """Courses of overlapping tiles or slates, each course shading the next."""

    size: int
    seed: int
    palette: Palette
    rows: int
    columns: int
    rounded: float
    """How far the tiles' lower edges are rounded, 0..1."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        hue, chroma, base = choose(
            rng, [(35.0, 0.1, 0.5), (40.0, 0.07, 0.42), (260.0, 0.015, 0.38), (60.0, 0.02, 0.5)]
        )
        base += uniform(rng, -0.05, 0.08)
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=tuple(shade(base + step, chroma, hue + 60 * step) for step in (-0.08, 0.0, 0.07)),
            rows=2 * integer(rng, 5, 8),
            columns=2 * integer(rng, 5, 9),
            rounded=uniform(rng, 0.0, 0.4),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        across = np.abs(fraction(x * self.columns) - np.float32(0.5))
        v = y * self.rows + np.float32(self.rounded) * (2 * across) ** 2
        row = np.floor(v).astype(np.int32) % self.rows
        u = x * self.columns + np.float32(0.5) * (row % 2)
        column = np.floor(u).astype(np.int32) % self.columns
        tone = rng.uniform(0.0, 1.0, (self.rows, self.columns)).astype(np.float32)[row, column]
        shadow = np.float32(0.5) + np.float32(0.5) * smooth_step(fraction(v), 0.1, 0.2)
        gap = np.float32(0.7) + np.float32(0.3) * smooth_step(
            np.minimum(fraction(u), 1 - fraction(u)), 0.05, 0.06
        )
        moss = 1 + np.float32(0.12) * spectral_noise(rng, self.size, 1.2, 1)
        return finish(colorize(tone, self.palette) * (shadow * gap * moss), rng, 0.07)

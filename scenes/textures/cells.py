"""Cellular patterns: mosaics, cobblestones, cracked mud, scales."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.kernels import nearest_of_grid
from scenes.appearance.painting import (
    Field,
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
from scenes.random_draws import integer, new_seed, uniform
from scenes.spec import Texture


def cellular_noise(
    rng: np.random.Generator, x: Field, y: Field, cells: int, jitter: float
) -> tuple[NDArray[np.int32], Field, Field]:
    """Cellular noise on a periodic jittered grid of cells x cells points (Worley 1996).

    `x`, `y` (H, W) are places in pictures, of period 1; `jitter` is 0 for a square grid, 1 for a random one.
    Returns, (H, W) each, the index of the nearest point, the distance to it and that to the second nearest, in
    grid steps. Only the 3 x 3 neighbouring cells are searched.
    """
    points = 0.5 + jitter * rng.uniform(-0.5, 0.5, (2, cells, cells))
    # Absolute positions with a margin of one cell on every side, so that neighbours need no wrapping.
    step = np.arange(-1, cells + 1)
    px = np.pad(points[0], 1, mode="wrap") + step[None, :]
    py = np.pad(points[1], 1, mode="wrap") + step[:, None]
    px, py = px.astype(np.float32).ravel(), py.astype(np.float32).ravel()
    x, y = fraction(x) * np.float32(cells), fraction(y) * np.float32(cells)
    nearest, first, second = nearest_of_grid(x, y, px, py, cells)
    inner_row, inner_column = np.divmod(nearest, cells + 2)
    cell = (inner_row - 1) % cells * cells + (inner_column - 1) % cells
    return cell.astype(np.int32), np.sqrt(first), np.sqrt(second)


@dataclass(frozen=True)
class VoronoiCells(Texture):
    """Voronoi cells of different colours between joints: mosaics, terrazzo, giraffes, dry earth."""

    size: int
    seed: int
    palette: Palette
    joint: Srgb
    cells: int
    """Cells along one side."""
    jitter: float
    """0 a square grid, 1 fully irregular."""
    joint_width: float
    """In cells; 0 for none."""
    warp: float
    """Amplitude of the joints' waves, in cells."""
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, integer(rng, 3, 7))
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette[1:],
            joint=palette[0],
            cells=integer(rng, 4, 22),
            jitter=uniform(rng, 0.5, 1.0),
            joint_width=uniform(rng, 0.03, 0.2) if rng.random() < 0.7 else 0.0,
            warp=uniform(rng, 0.0, 0.25),
            grain=uniform(rng, 0.04, 0.14),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        bend = np.float32(self.warp / self.cells)
        x = x + bend * spectral_noise(rng, self.size, 1.5, self.cells / 2)
        y = y + bend * spectral_noise(rng, self.size, 1.5, self.cells / 2)
        nearest, first, second = cellular_noise(rng, x, y, self.cells, self.jitter)
        place = rng.uniform(0.0, 1.0, self.cells**2).astype(np.float32)[nearest]
        picture = colorize(place, self.palette)
        picture = picture * (1 + np.float32(0.12) * spectral_noise(rng, self.size, 0.9, 3))
        if self.joint_width > 0:
            cover = 1 - smooth_step(second - first, self.joint_width, self.joint_width * 0.6)
            picture = mix(picture, paint(self.joint), cover)
        return finish(picture, rng, self.grain)


@dataclass(frozen=True)
class Cobblestones(Texture):
    """Rounded stones, shaded as if lit from one side, in dark gaps: paving, scales, pebbles."""

    size: int
    seed: int
    palette: Palette
    cells: int
    """Stones along one side."""
    jitter: float
    roundness: float
    """0 flat stones, 1 domes."""
    light_deg: float
    """Direction the painted shading comes from."""
    grain: float

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, 4),
            cells=integer(rng, 5, 24),
            jitter=uniform(rng, 0.3, 0.95),
            roundness=uniform(rng, 0.3, 1.0),
            light_deg=uniform(rng, 0.0, 360.0),
            grain=uniform(rng, 0.06, 0.15),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        nearest, first, second = cellular_noise(rng, x, y, self.cells, self.jitter)
        gap = second - first
        height = np.tanh(gap * np.float32(2.5)) - np.float32(self.roundness) * first**2
        slope_x = np.roll(height, -1, 1) - np.roll(height, 1, 1)
        slope_y = np.roll(height, -1, 0) - np.roll(height, 1, 0)
        angle = np.radians(self.light_deg)
        shading = (slope_x * np.float32(np.cos(angle)) + slope_y * np.float32(np.sin(angle))) * self.size / 40
        tone = rng.uniform(0.0, 1.0, self.cells**2).astype(np.float32)[nearest]
        tone = tone + np.float32(0.15) * spectral_noise(rng, self.size, 0.8, 3)
        light = np.clip(1 + np.float32(0.6) * np.tanh(shading), 0.2, 2.0)
        light = light * (np.float32(0.25) + np.float32(0.75) * smooth_step(gap, 0.1, 0.16))
        stains = 0.8 + np.float32(0.4) * to_unit(spectral_noise(rng, self.size, 1.2, 1))
        return finish(colorize(tone, self.palette) * (light * stains), rng, self.grain)

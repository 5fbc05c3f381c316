"""Pictures of many shapes: overlapping ones, blurred ones, rows of glyphs, facades."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from scenes.appearance.kernels import stamp
from scenes.appearance.painting import (
    Field,
    Palette,
    Picture,
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
from scenes.random_draws import chance, choose, integer, log_uniform, new_seed, uniform
from scenes.spec import NAME_ON_DISK, Texture


def overlapping_shapes(
    rng: np.random.Generator, size: int, radii: NDArray[np.float64], corners: int
) -> tuple[NDArray[np.int16], Field]:
    """Shapes painted over one another on a periodic picture of `size` x `size` pixels.

    `radii` (N,) are in pixels; `corners` is 0 for discs, 3 or more for polygons, -1 for a mixture. Returns,
    (H, W) each, the shape on top at each pixel, counted from 1 (0: none), and a linear ramp across each shape,
    -1..1 in a random direction.
    """
    top = np.zeros((size, size), np.int16)
    centres = rng.integers(0, size, (len(radii), 2))
    angles = rng.uniform(0.0, 2 * np.pi, len(radii))
    squeezes = rng.uniform(0.4, 1.0, len(radii))
    kinds = rng.choice([0, 3, 4, 4, 5, 6], len(radii)) if corners < 0 else np.full(len(radii), corners)
    cosines, sines = np.cos(angles), np.sin(angles)
    for i, radius in enumerate(radii):
        reach = int(np.ceil(radius))
        offset = np.arange(-reach, reach + 1, dtype=np.float32) / np.float32(radius)
        across, down = offset[None, :], offset[:, None]
        u = cosines[i].astype(np.float32) * across + sines[i].astype(np.float32) * down
        v = cosines[i].astype(np.float32) * down - sines[i].astype(np.float32) * across
        v /= np.float32(squeezes[i])
        inside = _shape_gauge(u, v, int(kinds[i])) <= 1
        stamp(top, inside, centres[i, 0], centres[i, 1], np.int16(i + 1))
    owner = np.maximum(top - 1, 0)
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    dx = (x - centres[owner, 1] + size // 2) % size - size // 2
    dy = (y - centres[owner, 0] + size // 2) % size - size // 2
    ramp = (dx * cosines[owner] + dy * sines[owner]) / radii[owner]
    return top, (ramp * (top > 0)).astype(np.float32)


def _shape_gauge(u: Field, v: Field, corners: int) -> Field:
    """(H, W) gauge function of a disc (corners 0) or a regular polygon of unit radius: at most 1 inside."""
    if corners == 0:
        return np.hypot(u, v)
    if corners == 4:
        return np.maximum(np.abs(u), np.abs(v)) * np.float32(np.sqrt(2.0))
    sector = 2 * np.pi / corners
    angle = np.arctan2(v, u) % np.float32(sector) - np.float32(sector / 2)
    return np.hypot(u, v) * np.cos(angle) / np.float32(np.cos(sector / 2))


@dataclass(frozen=True)
class DeadLeaves(Texture):
    """The dead leaves model: shapes of all sizes that occlude one another, scale invariant as photographs are.

    Lee, Mumford, Huang, "Occlusion models for natural images", 2001; the density of radii falls as r^-3.
    """

    size: int
    seed: int
    palette: Palette
    corners: int
    """0 for discs, 3 or more for polygons, -1 for a mixture."""
    shapes: int = field(metadata={NAME_ON_DISK: "figures"})
    smallest: float
    """Radius in pixels."""
    largest: float
    """Radius as a share of the picture."""
    grain: float

    popularity: ClassVar[float] = 2.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, integer(rng, 4, 10)),
            corners=choose(rng, [0, 0, 4, 4, 3, -1, -1, -1]),
            shapes=integer(rng, 100, 260),
            smallest=uniform(rng, 2.0, 6.0),
            largest=uniform(rng, 0.12, 0.25),
            grain=uniform(rng, 0.03, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        low, high = self.smallest, self.largest * self.size
        share = rng.uniform(0.0, 1.0, self.shapes)
        radii = (low**-2 + share * (high**-2 - low**-2)) ** -0.5
        # Small shapes lie over big ones; the other way round only the big ones would show.
        big = self.shapes // 6
        radii[:big] = rng.uniform(0.4 * high, high, big)
        top, ramp = overlapping_shapes(rng, self.size, radii, self.corners)
        colors = np.array(self.palette, np.float32)[rng.integers(0, len(self.palette), self.shapes + 1)]
        colors *= rng.uniform(0.7, 1.25, (self.shapes + 1, 1)).astype(np.float32)
        slopes = rng.normal(0.0, 0.25, self.shapes + 1).astype(np.float32)
        # Each shape shows its own part of the noise, as each leaf has its own veins.
        noise = spectral_noise(rng, self.size, 0.8, 4).ravel()
        shift = rng.integers(0, self.size**2, self.shapes + 1)[top].ravel()
        detail = noise[(np.arange(self.size**2) + shift) % self.size**2].reshape(top.shape)
        light = 1 + slopes[top] * ramp + np.float32(0.13) * detail
        return finish(flat_colors(top, colors) * light, rng, self.grain)


@dataclass(frozen=True)
class BlurredShapes(Texture):
    """Blurred overlapping shapes: bokeh, stained walls, watercolour."""

    size: int
    seed: int
    palette: Palette
    shapes: int = field(metadata={NAME_ON_DISK: "figures"})
    blur: float
    """Standard deviation of the blur as a share of the picture."""
    grain: float

    popularity: ClassVar[float] = 0.7

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, integer(rng, 4, 8)),
            shapes=integer(rng, 25, 90),
            blur=log_uniform(rng, 0.004, 0.02),
            grain=uniform(rng, 0.05, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        size = self.size
        radii = size * np.exp(rng.uniform(np.log(0.03), np.log(0.18), self.shapes))
        top, _ = overlapping_shapes(rng, size, radii, -1)
        colors = np.array(self.palette, np.float32)[rng.integers(0, len(self.palette), self.shapes + 1)]
        fy, fx = fft.fftfreq(size).astype(np.float32), fft.rfftfreq(size).astype(np.float32)
        gain = np.exp(-2 * (np.pi * self.blur * size) ** 2 * (fx[None, :] ** 2 + fy[:, None] ** 2))
        spectrum = fft.rfft2(flat_colors(top, colors)) * gain.astype(np.float32)
        blurred: Picture = fft.irfft2(spectrum, s=(size, size))
        blurred *= 1 + np.float32(0.1) * spectral_noise(rng, size, 0.8, 3)
        return finish(blurred, rng, self.grain)


@dataclass(frozen=True)
class GlyphRows(Texture):
    """Lines of words in an invented alphabet: print, signs, labels."""

    size: int
    seed: int
    palette: Palette
    """The paper, then the inks."""
    lines: int
    letters: int
    """Letters and spaces in a line."""
    alphabet: int
    """Number of different letters."""
    grain: float

    popularity: ClassVar[float] = 0.8

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        lines = integer(rng, 4, 16)
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, integer(rng, 2, 3)),
            lines=lines,
            letters=round(lines * uniform(rng, 1.3, 1.8)),
            alphabet=integer(rng, 10, 30),
            grain=uniform(rng, 0.03, 0.1),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        glyphs = self._alphabet(rng)
        text = rng.integers(1, self.alphabet + 1, (self.lines, self.letters))
        text[rng.random(text.shape) < 0.17] = 0
        inks = rng.integers(1, len(self.palette), self.lines)
        # Letters are 5 x 7 in cells of 6 x 10.
        x, y = unit_grid(self.size)
        column, row = (x * (6 * self.letters)).astype(np.int32), (y * (10 * self.lines)).astype(np.int32)
        letter = text[row // 10 % self.lines, column // 6 % self.letters]
        on = glyphs[letter, row % 10, column % 6]
        paper = paint(self.palette[0]) * (1 + np.float32(0.06) * spectral_noise(rng, self.size, 1.0, 1))
        ink = flat_colors(inks[row // 10 % self.lines], self.palette)
        return finish(mix(paper, ink, on * np.float32(0.92)), rng, self.grain)

    def _alphabet(self, rng: np.random.Generator) -> Field:
        """(1 + alphabet, 10, 6) pictures of letters made of a few straight strokes; the first is a space."""
        glyphs = np.zeros((self.alphabet + 1, 10, 6), np.float32)
        for glyph in glyphs[1:]:
            for stroke in rng.choice(10, int(rng.integers(2, 5)), replace=False):
                if stroke < 3:
                    glyph[1:8, (0, 2, 4)[stroke]] = 1
                elif stroke < 6:
                    glyph[(1, 4, 7)[stroke - 3], :5] = 1
                else:
                    half = slice(0, 4) if stroke < 8 else slice(3, 7)
                    slant = np.array([0, 1, 1, 2, 3, 3, 4])[:: 1 if stroke % 2 else -1]
                    glyph[np.arange(1, 8)[half], slant[half]] = 1
        return glyphs


@dataclass(frozen=True)
class Facade(Texture):
    """Rows of framed windows, some lit, in a weathered wall."""

    size: int
    seed: int
    palette: Palette
    """Wall, frames, panes dark and light."""
    floors: int
    bays: int
    window: tuple[float, float]
    """Width and height as shares of a bay."""
    grain: float

    popularity: ClassVar[float] = 0.7

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        floors = integer(rng, 3, 10)
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=sample_palette(rng, 4),
            floors=floors,
            bays=max(2, round(floors * uniform(rng, 0.6, 1.5))),
            window=(uniform(rng, 0.35, 0.8), uniform(rng, 0.4, 0.8)),
            grain=uniform(rng, 0.05, 0.14),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        u, v = x * self.bays, y * self.floors
        bay, floor = u.astype(np.int32) % self.bays, v.astype(np.int32) % self.floors
        across = np.abs(fraction(u) - np.float32(0.5)) / np.float32(self.window[0] / 2)
        up = np.abs(fraction(v) - np.float32(0.5)) / np.float32(self.window[1] / 2)
        edge = np.maximum(across, up)
        opening = (edge < 1).astype(np.float32)
        pane = ((edge < 0.85) & (np.minimum(across, up) > 0.06)).astype(np.float32)
        stains = np.clip(1 + np.float32(0.16) * spectral_noise(rng, self.size, 1.1, 1), 0.3, 1.7)
        lit = rng.uniform(0.0, 1.0, (self.floors, self.bays)).astype(np.float32)[floor, bay]
        glass = colorize(lit + np.float32(0.3) * (fraction(v) - np.float32(0.5)), self.palette[2:])
        reflections = np.float32(0.6) + np.float32(0.8) * to_unit(spectral_noise(rng, self.size, 1.4, 3))
        # A darker line under each window: the sill's shadow.
        sill = smooth_step(fraction(v), 0.5 + self.window[1] / 2, 0.01) * (
            fraction(v) < 0.56 + self.window[1] / 2
        )
        wall = paint(self.palette[0]) * (stains * (1 - np.float32(0.4) * sill * (across < 1.1)))
        picture = mix(wall, paint(self.palette[1]) * stains, opening)
        picture = mix(picture, glass * reflections, pane)
        if chance(rng, 0.5):
            picture *= 1 - np.float32(0.4) * (fraction(v) > 0.965)
        return finish(picture, rng, self.grain)

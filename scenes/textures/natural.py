"""Natural surfaces: bark, litter, layered rock, hair, leaf veins, eyes."""

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
    mix,
    paint,
    sample_palette,
    smooth_step,
    spectral_noise,
    to_unit,
    unit_grid,
)
from scenes.random_draws import chance, integer, log_uniform, new_seed, uniform
from scenes.spec import Texture


@dataclass(frozen=True)
class RoughBark(Texture):
    """Upright ridges with dark cracks between them and patches of lichen: trunks, weathered timber."""

    size: int
    seed: int
    palette: Palette
    """From cracks to ridges."""
    lichen: Srgb
    lichen_cover: float
    """0..1."""
    cycles: float
    """Ridges across the picture."""
    stretch: float
    """Length to width of the ridges."""
    grain: float

    popularity: ClassVar[float] = 0.5

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, 4)
        return cls.of(rng, size, palette[:3], palette[3])

    @classmethod
    def of(cls, rng: np.random.Generator, size: int, palette: Palette, lichen: Srgb) -> Self:
        """A random instance in given colours."""
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            lichen=lichen,
            lichen_cover=uniform(rng, 0.1, 0.5) if chance(rng, 0.5) else 0.0,
            cycles=log_uniform(rng, 6.0, 18.0),
            stretch=uniform(rng, 2.5, 6.0),
            grain=uniform(rng, 0.06, 0.14),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        across = self.cycles
        ridges = spectral_noise(rng, self.size, 1.0, across, 4 * across, stretch=(1.0, self.stretch))
        depth = np.float32(1) - np.exp(-np.abs(ridges) * np.float32(1.6))
        tone = np.float32(0.8) * depth + np.float32(0.12) * spectral_noise(rng, self.size, 1.0, 2)
        picture = colorize(tone, self.palette)
        if self.lichen_cover > 0:
            patches = spectral_noise(rng, self.size, 1.3, 3)
            cover = smooth_step(patches, 1.4 - 2.0 * self.lichen_cover, 0.4) * (np.float32(0.3) + depth)
            picture = mix(picture, paint(self.lichen), np.clip(cover * np.float32(0.7), 0, 1))
        return finish(picture, rng, self.grain)


@dataclass(frozen=True)
class Litter(Texture):
    """Short strokes over one another in all directions: grass from above, fallen leaves, straw, moss."""

    size: int
    seed: int
    palette: Palette
    """From the lowest to the topmost layer."""
    length_px: float
    aspect: float
    """Length to width of a stroke."""
    layers: int
    alignment: float
    """0: strokes in all directions; 1: all along y."""
    grain: float

    popularity: ClassVar[float] = 0.8

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls.of(rng, size, sample_palette(rng, integer(rng, 3, 6)))

    @classmethod
    def of(cls, rng: np.random.Generator, size: int, palette: Palette) -> Self:
        """A random instance in given colours."""
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            length_px=log_uniform(rng, 8.0, 22.0),
            aspect=uniform(rng, 2.0, 6.0),
            layers=integer(rng, 3, 4),
            alignment=uniform(rng, 0.0, 0.7),
            grain=uniform(rng, 0.05, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        """Paint layers of strokes; each layer is one operation on arrays."""
        rng = np.random.default_rng(self.seed)
        tone = np.float32(0.15) + np.float32(0.1) * spectral_noise(rng, self.size, 1.0, 3)
        for layer in range(self.layers):
            self._stamp(rng, tone, (layer + 1) / self.layers)
        patches = np.float32(0.1) * spectral_noise(rng, self.size, 1.5, 1, 8)
        return finish(colorize(tone + patches, self.palette), rng, self.grain)

    def _stamp(self, rng: np.random.Generator, tone: NDArray[np.float32], height: float) -> None:
        """Lay one layer of strokes over `tone`, brighter along their middle."""
        spacing = self.length_px * 0.5
        count = max(1, round((self.size / spacing) ** 2))
        reach = int(np.ceil(self.length_px / 2))
        offset = np.arange(-reach, reach + 1, dtype=np.float32)
        angle = rng.uniform(0, np.pi, count) * (1 - self.alignment) + np.pi / 2 * self.alignment
        cos, sin = np.cos(angle).astype(np.float32), np.sin(angle).astype(np.float32)
        x, y = offset[None, None, :], offset[None, :, None]
        along = (x * cos[:, None, None] + y * sin[:, None, None]) / np.float32(self.length_px / 2)
        aside = (y * cos[:, None, None] - x * sin[:, None, None]) / np.float32(
            self.length_px / 2 / self.aspect
        )
        # A pointed oval, its rim darker than its middle rib.
        gauge = np.abs(aside) + along * along
        shade = (height * rng.uniform(0.55, 1.0, count)).astype(np.float32)[:, None, None]
        painted = shade * (np.float32(1.05) - np.float32(0.35) * np.abs(aside))
        which, row, column = np.nonzero(gauge < 1)
        centre = rng.integers(0, self.size, (count, 2))
        rows = (centre[which, 0] + row - reach) % self.size
        columns = (centre[which, 1] + column - reach) % self.size
        tone[rows, columns] = painted[which, row, column]


@dataclass(frozen=True)
class Strata(Texture):
    """Layered, cracked and stained rock, with moss, sand or snow in its hollows."""

    size: int
    seed: int
    palette: Palette
    dust: Srgb
    dust_cover: float
    """0..1."""
    layers: int
    """Layers per picture; 0 for massive rock."""
    bend: float
    """Amplitude of the layers' waves, in layers."""
    cracks: float
    """Strength of dark cracks, 0..1."""
    slope: float
    grain: float

    popularity: ClassVar[float] = 0.8

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, 5)
        return cls.of(rng, size, palette[:4], palette[4])

    @classmethod
    def of(cls, rng: np.random.Generator, size: int, palette: Palette, dust: Srgb) -> Self:
        """A random instance in given colours."""
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            dust=dust,
            dust_cover=uniform(rng, 0.1, 0.6) if chance(rng, 0.6) else 0.0,
            layers=integer(rng, 3, 9) if chance(rng, 0.5) else 0,
            bend=uniform(rng, 0.3, 1.2),
            cracks=uniform(rng, 0.2, 0.8),
            slope=uniform(rng, 0.8, 1.2),
            grain=uniform(rng, 0.06, 0.14),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        rough = spectral_noise(rng, self.size, self.slope, 2)
        tone = np.float32(0.5) + np.float32(0.2) * rough
        if self.layers > 0:
            y = unit_grid(self.size)[1]
            warp = np.float32(self.bend) * spectral_noise(rng, self.size, 1.6, 1)
            tone = tone + np.float32(0.18) * np.sin(np.float32(2 * np.pi) * (self.layers * y + warp))
        veins = np.abs(spectral_noise(rng, self.size, 1.1, 4, 40))
        crack = np.float32(self.cracks) * (1 - smooth_step(veins, 0.06, 0.12))
        picture = colorize(tone, self.palette) * (1 - np.float32(0.75) * crack)
        if self.dust_cover > 0:
            settled = spectral_noise(rng, self.size, 1.2, 2) - np.float32(0.4) * rough
            picture = mix(picture, paint(self.dust), smooth_step(settled, 1.5 - 2.4 * self.dust_cover, 0.7))
        return finish(picture, rng, self.grain)


@dataclass(frozen=True)
class Hair(Texture):
    """Combed strands, some with spots or bands of another colour: fur, hair, dry grass, thatch."""

    size: int
    seed: int
    palette: Palette
    """Shadow, strand, highlight."""
    marking: Srgb
    pattern: str
    """none, spots or bands."""
    cycles: float
    """Strands across the picture."""
    grain: float

    popularity: ClassVar[float] = 0.6

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, 4)
        return cls.of(rng, size, palette[:3], palette[3])

    @classmethod
    def of(cls, rng: np.random.Generator, size: int, palette: Palette, marking: Srgb) -> Self:
        """A random instance in given colours."""
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            marking=marking,
            pattern=("none", "spots", "bands")[int(rng.integers(3))],
            cycles=log_uniform(rng, 14.0, 40.0),
            grain=uniform(rng, 0.05, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        strands = spectral_noise(rng, self.size, 0.6, self.cycles * 0.5, stretch=(1.0, 5.0))
        tone = to_unit(strands + np.float32(0.4) * spectral_noise(rng, self.size, 1.2, 2))
        picture = colorize(tone, self.palette)
        if self.pattern != "none":
            low = (4.0, 4.0) if self.pattern == "spots" else (3.0, 0.7)
            field = spectral_noise(rng, self.size, 0.2, 5, 8, stretch=(1.0, low[1] / low[0] * 1.0))
            ragged = field + np.float32(0.25) * strands
            cover = smooth_step(ragged, 0.5, 0.35)
            picture = mix(picture, paint(self.marking) * (np.float32(0.6) + np.float32(0.5) * tone), cover)
        return finish(picture, rng, self.grain)


@dataclass(frozen=True)
class LeafVeins(Texture):
    """The surface of leaves: blotches, a net of pale veins, brown blemishes."""

    size: int
    seed: int
    palette: Palette
    vein: Srgb
    vein_strength: float
    spots: float
    """Share of blemishes, 0..1."""
    grain: float

    popularity: ClassVar[float] = 0.5

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        palette = sample_palette(rng, 4)
        return cls.of(rng, size, palette[:3], palette[3])

    @classmethod
    def of(cls, rng: np.random.Generator, size: int, palette: Palette, vein: Srgb) -> Self:
        """A random instance in given colours."""
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            vein=vein,
            vein_strength=uniform(rng, 0.2, 0.6),
            spots=uniform(rng, 0.0, 0.25),
            grain=uniform(rng, 0.05, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        blotch = spectral_noise(rng, self.size, 1.0, 3)
        bend = np.float32(0.35) * spectral_noise(rng, self.size, 1.8, 1)
        # Side veins at an angle to a midrib, four leaves a picture.
        rows = np.abs(fraction(4 * x) - np.float32(0.5))
        side = np.abs(fraction(12 * y + 8 * rows + bend) - np.float32(0.5))
        net = np.maximum(1 - smooth_step(side, 0.08, 0.12), 1 - smooth_step(rows, 0.04, 0.05))
        fine = 1 - smooth_step(np.abs(spectral_noise(rng, self.size, 0.6, 16, 60)), 0.1, 0.2)
        picture = colorize(to_unit(blotch), self.palette)
        veins = np.float32(self.vein_strength) * np.maximum(net, np.float32(0.35) * fine)
        picture = mix(picture, paint(self.vein), veins)
        blemish = smooth_step(spectral_noise(rng, self.size, 1.0, 8, 50), 2.6 - 3 * self.spots, 0.4)
        return finish(picture * (1 - np.float32(0.5) * blemish), rng, self.grain)


@dataclass(frozen=True)
class Iris(Texture):
    """An eye centred on the picture's corner: pupil, streaked iris with a dark rim, veined white."""

    size: int
    seed: int
    iris: Palette
    white: Srgb
    iris_radius: float
    """As a share of half the picture."""
    pupil: float
    """As a share of the iris."""
    slit: float
    """Width to height of the pupil: 1 round, 0.3 a cat's."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            iris=sample_palette(rng, 3),
            white=(250, 247, 240) if chance(rng, 0.7) else sample_palette(rng, 2)[1],
            iris_radius=uniform(rng, 0.28, 0.42),
            pupil=uniform(rng, 0.4, 0.62),
            slit=1.0 if chance(rng, 0.7) else uniform(rng, 0.25, 0.5),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        x, y = (np.float32(2) * (axis - np.round(axis)) for axis in (x, y))
        radius, angle = np.hypot(x, y), np.arctan2(y, x)
        streaks = sum(
            np.sin(angle * number + np.float32(phase)) / 3
            for number, phase in zip(rng.integers(7, 40, 6), rng.uniform(0, 2 * np.pi, 6), strict=True)
        )
        share = radius / np.float32(self.iris_radius)
        picture = colorize(share * np.float32(0.8) + np.float32(0.15) * streaks, self.iris)
        picture = picture * (1 - np.float32(0.7) * smooth_step(share, 0.92, 0.15))
        white = paint(self.white) * (1 - np.float32(0.06) * np.abs(spectral_noise(rng, self.size, 1.0, 4)))
        picture = mix(picture, white, smooth_step(share, 1.0, 0.06))
        pupil = np.hypot(x / np.float32(self.slit), y) / np.float32(self.iris_radius * self.pupil)
        picture = picture * smooth_step(pupil, 1.0, 0.1)
        glint = np.hypot(x - np.float32(0.12), y + np.float32(0.12))
        picture = mix(picture, paint((255, 255, 255)), 1 - smooth_step(glint, 0.07, 0.04))
        return finish(picture, rng, 0.02)

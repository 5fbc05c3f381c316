"""Surfaces with fine structure: cloth as it is woven, sand as the wind leaves it, rock as it breaks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import (
    Field,
    Palette,
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
from scenes.random_draws import chance, choose, integer, new_seed, uniform
from scenes.spec import Texture


@dataclass(frozen=True)
class WovenCloth(Texture):
    """Fine threads, uneven as they are spun, plain, in stripes along one way, faded and stained by wear."""

    size: int
    seed: int
    palette: Palette
    """The cloth, its stripes or its embroidery, what it fades to."""
    weave: str
    """linen, twill or knit."""
    threads: int
    """Threads along one side; a multiple of 4."""
    relief: float
    """How much darker the gaps between threads are, 0..1."""
    stripes: int
    """Groups of stripes along the picture; 0 for none."""
    wear: float
    """Share that is faded, 0..1."""
    grain: float

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls.of(rng, size, sample_palette(rng, 3))

    @classmethod
    def of(cls, rng: np.random.Generator, size: int, palette: Palette) -> Self:
        """A random instance in given colours."""
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            weave=choose(rng, ("linen", "twill", "knit"), (0.5, 0.3, 0.2)),
            threads=4 * integer(rng, 12, 26),
            relief=uniform(rng, 0.15, 0.45),
            stripes=integer(rng, 2, 7) if chance(rng, 0.35) else 0,
            wear=uniform(rng, 0.1, 0.6) if chance(rng, 0.5) else 0.0,
            grain=uniform(rng, 0.02, 0.06),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        # Threads are thicker here and thinner there, along their whole length.
        slubs = spectral_noise(rng, self.size, 0.5, 4, stretch=(1.0, 14.0))
        uneven = np.float32(0.05) * (slubs + spectral_noise(rng, self.size, 0.5, 4, stretch=(14.0, 1.0)))
        light = (1 - np.float32(self.relief) * self._gaps(x, y)) * (1 + uneven)
        picture = paint(self.palette[0]) + np.zeros_like(x)
        if self.stripes:
            picture = mix(picture, paint(self.palette[1]), self._bands(rng, x))
        if self.wear > 0:
            patches = spectral_noise(rng, self.size, 1.2, 1) + np.float32(0.3) * slubs
            faded = np.float32(0.6) * smooth_step(patches, 1.4 - 2.4 * self.wear, 1.2)
            picture = mix(picture, paint(self.palette[2]), faded)
        return finish(picture * light, rng, self.grain)

    def _gaps(self, x: Field, y: Field) -> Field:
        """(H, W) 0 on top of a thread .. 1 between threads."""
        u, v = x * self.threads, y * self.threads
        if self.weave == "knit":  # Columns of loops, each a V.
            slant = np.abs(fraction(u / 2) - np.float32(0.5))
            gaps = np.abs(2 * fraction(v / 2 + 2 * slant) - 1)
            return np.asarray(gaps * gaps, np.float32)
        step = 4 if self.weave == "twill" else 2
        over = (np.floor(u) + np.floor(v)) % step < step / 2
        across = np.where(over, fraction(v), fraction(u)) - np.float32(0.5)
        return np.asarray(4 * across * across, np.float32)

    def _bands(self, rng: np.random.Generator, x: Field) -> Field:
        """(H, W) 0..1 where stripes are: in each group a few, of different widths."""
        place = fraction(x * self.stripes)
        cover = np.zeros_like(x)
        start = 0.08
        for _ in range(int(rng.integers(1, 4))):
            width = float(rng.uniform(0.03, 0.22))
            edge = 1.5 * self.stripes / self.size
            cover += smooth_step(place, start, edge) * (1 - smooth_step(place, start + width, edge))
            start += width + float(rng.uniform(0.03, 0.15))
        return np.clip(cover, 0, 1)


@dataclass(frozen=True)
class SandRipples(Texture):
    """Ripples that the wind draws, forking and fading out, on sand or snow of one hue; grit and small stones."""

    size: int
    seed: int
    palette: Palette
    """Dark to light."""
    ripples: int
    """Along the picture."""
    bend: float
    """How far they stray, in ripples."""
    strength: float
    """0..1."""
    stones: float
    """Share that is strewn with dark grit, 0..1."""
    grain: float

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls.of(rng, size, sample_palette(rng, 4))

    @classmethod
    def of(cls, rng: np.random.Generator, size: int, palette: Palette) -> Self:
        """A random instance in given colours."""
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            ripples=integer(rng, 8, 26),
            bend=uniform(rng, 0.8, 2.2),
            strength=uniform(rng, 0.2, 0.55),
            stones=uniform(rng, 0.05, 0.3) if chance(rng, 0.6) else 0.0,
            grain=uniform(rng, 0.05, 0.12),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        y = unit_grid(self.size)[1]
        bend = np.float32(self.bend) * spectral_noise(rng, self.size, 1.5, 1, 14)
        phase = fraction(self.ripples * y + bend)
        # A long slope to windward and a short one to lee, which lies in shade.
        crest = np.where(phase < 0.7, phase / np.float32(0.7), (1 - phase) / np.float32(0.3))
        where = smooth_step(spectral_noise(rng, self.size, 1.2, 1), -0.6, 1.2)
        tone = np.float32(0.55) + np.float32(self.strength) * where * (crest - np.float32(0.5))
        tone = tone + np.float32(0.09) * spectral_noise(rng, self.size, 1.0, 2)
        picture = colorize(tone.astype(np.float32), self.palette)
        if self.stones > 0:
            grit = smooth_step(spectral_noise(rng, self.size, 0.3, 30), 2.6 - 2.0 * self.stones, 0.4)
            picture = picture * (1 - np.float32(0.45) * grit)
        return finish(picture, rng, self.grain)


@dataclass(frozen=True)
class HewnRock(Texture):
    """Rock at every scale: joints that cross, chipped faces of different tones, lichen, fine grain."""

    size: int
    seed: int
    palette: Palette
    """Dark to light, lichen last."""
    joints: int
    """Cracks across the picture, each way."""
    chips: float
    """Contrast of the faces, 0..1."""
    lichen: float
    """Share covered, 0..1."""
    grain: float

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls.of(rng, size, sample_palette(rng, 5))

    @classmethod
    def of(cls, rng: np.random.Generator, size: int, palette: Palette) -> Self:
        """A random instance in given colours, the last of them its lichen's."""
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=palette,
            joints=integer(rng, 2, 6),
            chips=uniform(rng, 0.4, 1.0),
            lichen=uniform(rng, 0.05, 0.4) if chance(rng, 0.6) else 0.0,
            grain=uniform(rng, 0.06, 0.13),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        warp = np.float32(0.5) * spectral_noise(rng, self.size, 1.5, 1)
        course = self.joints * y + warp
        # Each column of rock has slipped against the next, each bed has its joints elsewhere.
        beds = fraction(course + np.float32(0.25) * np.round(4 * x))
        shift = np.float32(0.37) * (np.floor(course) % self.joints)
        blocks = fraction(self.joints * x + np.float32(0.7) * warp + shift)
        edge = np.minimum(np.minimum(beds, 1 - beds), np.minimum(blocks, 1 - blocks) * np.float32(1.6))
        cracks = 1 - smooth_step(
            edge + np.float32(0.015) * spectral_noise(rng, self.size, 0.8, 8), 0.03, 0.05
        )
        # Faces knocked off at an angle: rounded-off noise gives flat tones with sharp borders.
        rough = spectral_noise(rng, self.size, 1.1, 2)
        faces = np.round(2 * rough) / 2 + np.float32(0.25) * spectral_noise(rng, self.size, 0.9, 6)
        tone = to_unit(np.float32(self.chips) * faces.astype(np.float32))
        picture = colorize(tone, self.palette[:-1]) * (1 - np.float32(0.6) * cracks)
        if self.lichen > 0:
            spots = smooth_step(spectral_noise(rng, self.size, 0.9, 5), 1.7 - 2.2 * self.lichen, 0.3)
            picture = mix(picture, paint(self.palette[-1]), np.float32(0.75) * spots)
        return finish(picture, rng, self.grain)

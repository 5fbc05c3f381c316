"""Streets at a fixed scale: asphalt, paving, road markings, signs, wheels.

Only the driving family uses them: each belongs on one kind of surface, at one scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from scenes.appearance.painting import (
    Field,
    Palette,
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
from scenes.random_draws import choose, integer, new_seed, uniform
from scenes.spec import Texture
from scenes.textures.cells import cellular_noise


@dataclass(frozen=True)
class Asphalt(Texture):
    """Bitumen with stones in it, darker and lighter patches, and cracks."""

    size: int
    seed: int
    color: Srgb
    stones: float
    """Contrast of the grit, standard deviation relative to the tone."""
    patches: float
    """Contrast of the slow variation."""
    cracks: float
    """Share of the cells' borders that have broken open, 0..1."""
    cells: int
    """Slabs between cracks along one side."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            color=shade(uniform(rng, 0.36, 0.58), uniform(rng, 0.0, 0.02), uniform(rng, 20.0, 280.0)),
            stones=uniform(rng, 0.1, 0.22),
            patches=uniform(rng, 0.04, 0.12),
            cracks=uniform(rng, 0.0, 0.6),
            cells=integer(rng, 2, 4),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        grit = spectral_noise(rng, self.size, 0.15, self.size / 12)
        slow = spectral_noise(rng, self.size, 1.3, 1)
        light = 1 + np.float32(self.stones) * grit + np.float32(self.patches) * slow
        x, y = unit_grid(self.size)
        bend = np.float32(0.06) * spectral_noise(rng, self.size, 1.4, 3)
        _, first, second = cellular_noise(rng, x + bend, y - bend, self.cells, 0.9)
        broken = smooth_step(
            slow + np.float32(0.7) * np.roll(slow, self.size // 3, 0), 1.2 - 2 * self.cracks, 0.8
        )
        crack = (1 - smooth_step(second - first, 0.02, 0.02)) * broken * np.float32(self.cracks > 0.1)
        picture = paint(self.color) * (np.clip(light, 0.25, 2.0) * (1 - np.float32(0.6) * crack))
        return finish(picture, rng, 0.06)


@dataclass(frozen=True)
class Paving(Texture):
    """Slabs or blocks of different shades with joints: pavements, driveways, copings."""

    size: int
    seed: int
    palette: Palette
    rows: int
    """Courses per picture; even."""
    columns: int
    bond: float
    """Shift of every other course, in slabs."""
    joint: float
    """Width of the joints relative to a course."""
    wear: float

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        hue, chroma = choose(rng, [(60.0, 0.012), (75.0, 0.03), (35.0, 0.06), (260.0, 0.008)])
        base = uniform(rng, 0.5, 0.72)
        rows = choose(rng, [4, 6, 8, 12, 16])
        return cls(
            size=size,
            seed=new_seed(rng),
            palette=tuple(
                shade(base + step, chroma * uniform(rng, 0.5, 1.5), hue)
                for step in (-0.07, -0.02, 0.02, 0.07)
            ),
            rows=rows,
            columns=max(2, round(rows / choose(rng, [1.0, 1.5, 2.0]))),
            bond=choose(rng, [0.5, 0.5, 0.0, 0.33]),
            joint=uniform(rng, 0.03, 0.09),
            wear=uniform(rng, 0.08, 0.2),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        v = y * self.rows
        row = np.floor(v).astype(np.int32) % self.rows
        u = x * self.columns + np.float32(self.bond) * (row % 2)
        column = np.floor(u).astype(np.int32) % self.columns
        tone = rng.uniform(0.0, 1.0, (self.rows, self.columns)).astype(np.float32)[row, column]
        across = np.minimum(fraction(u), 1 - fraction(u)) * np.float32(self.rows / self.columns)
        edge = np.minimum(across, np.minimum(fraction(v), 1 - fraction(v)))
        joint = np.float32(0.55) + np.float32(0.45) * smooth_step(edge, self.joint / 2, self.joint * 0.6)
        stains = 1 + np.float32(self.wear) * spectral_noise(rng, self.size, 1.1, 1)
        return finish(colorize(tone, self.palette) * (joint * np.clip(stains, 0.4, 1.5)), rng, 0.07)


@dataclass(frozen=True)
class RoadMarkingPaint(Texture):
    """The worn paint of road markings."""

    size: int
    seed: int
    color: Srgb
    below: Srgb
    """What shows where the paint is gone."""
    worn: float
    """Share that is gone, about."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size,
            new_seed(rng),
            shade(uniform(rng, 0.82, 0.94), 0.01, 90.0),
            (92, 92, 92),
            uniform(rng, 0.02, 0.3),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        noise = spectral_noise(rng, self.size, 0.7, 4)
        gone = 1 - smooth_step(noise, float(np.quantile(noise, self.worn)), 0.7)
        dirt = 1 + np.float32(0.06) * spectral_noise(rng, self.size, 1.1, 1)
        return finish(mix(paint(self.color) * dirt, paint(self.below), gone), rng, 0.06)


@dataclass(frozen=True)
class RoadSign(Texture):
    """The face of a traffic sign: a field with a border and a symbol.

    The picture is the bounding square of the plate.
    """

    size: int
    seed: int
    corners: int
    """Of the plate: 0 for a disc, 3, 4, 8."""
    field: Srgb
    border: Srgb
    ink: Srgb
    device: str
    """bar, arrow, digits, ring or cross."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        white, red, blue, black = (240, 240, 236), (190, 22, 30), (22, 70, 160), (24, 24, 26)
        yellow, green = (245, 190, 20), (20, 110, 60)
        corners, field, border, ink = choose(
            rng,
            [
                (0, white, red, black),
                (0, blue, white, white),
                (0, red, red, white),
                (3, white, red, black),
                (4, blue, white, white),
                (4, yellow, black, black),
                (4, green, white, white),
                (8, red, white, white),
            ],
        )
        return cls(
            size,
            new_seed(rng),
            corners,
            field,
            border,
            ink,
            choose(rng, ["bar", "arrow", "digits", "ring", "cross"]),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        u, v = 2 * x - 1, 1 - 2 * y
        picture = np.broadcast_to(paint(self.field), (3, *u.shape))
        rim = smooth_step(self._gauge(u, v), 0.84, 0.03)
        picture = mix(picture, paint(self.ink), self._device(rng, u, v).astype(np.float32))
        picture = mix(picture, paint(self.border), rim)
        return finish(picture * (1 + np.float32(0.04) * spectral_noise(rng, self.size, 1.2, 1)), rng, 0.03)

    def _gauge(self, u: Field, v: Field) -> Field:
        """1 on the plate's edge, 0 in its middle."""
        if self.corners == 0:
            return np.hypot(u, v)
        if self.corners == 4:
            return np.maximum(np.abs(u), np.abs(v))
        if self.corners == 3:
            # The triangle's middle lies below that of its bounding square.
            v = v + np.float32(0.2)
            return np.maximum(-v * 2, v + np.float32(1.55) * np.abs(u)) * np.float32(0.8)
        diagonal = (np.abs(u) + np.abs(v)) / np.float32(np.sqrt(2.0))
        return np.maximum(np.maximum(np.abs(u), np.abs(v)), diagonal)

    def _device(self, rng: np.random.Generator, u: Field, v: Field) -> NDArray[np.bool_]:
        if self.corners == 3:
            v = v + np.float32(0.25)
            u, v = u * np.float32(1.7), v * np.float32(1.7)
        if self.device == "bar":
            return (np.abs(u) < 0.6) & (np.abs(v) < 0.14)
        if self.device == "arrow":
            head = (v > 0.05) & (v < 0.55) & (np.abs(u) < (np.float32(0.55) - v) * np.float32(0.9))
            return head | ((np.abs(u) < 0.11) & (v > -0.55) & (v <= 0.1))
        if self.device == "ring":
            return np.abs(np.hypot(u, v) - np.float32(0.38)) < 0.11
        if self.device == "cross":
            return (np.abs(np.abs(u) - np.abs(v)) < 0.14) & (np.hypot(u, v) < 0.65)
        # Two or three numerals of seven segments each.
        count = int(rng.integers(2, 4))
        place = (u + np.float32(0.6)) * np.float32(count / 1.2)
        a, b = fraction(place) - np.float32(0.5), v / np.float32(0.42)
        on = rng.random((count, 7)) < 0.7
        digit = on[np.clip(place.astype(np.int32), 0, count - 1)]
        bars = [np.abs(b - level) < 0.14 for level in (-1.0, 0.0, 1.0)]
        sides = [np.abs(a - side) < 0.1 for side in (-0.28, 0.28)]
        wide, inside = np.abs(a) < 0.34, (np.abs(u) < 0.6) & (np.abs(b) < 1.14)
        lit = np.zeros(u.shape, bool)
        for k, bar in enumerate(bars):
            lit |= bar & wide & digit[..., k]
        for k, side in enumerate(sides):
            lit |= side & (b > 0) & digit[..., 3 + 2 * k]
            lit |= side & (b < 0) & digit[..., 4 + 2 * k]
        return lit & inside


@dataclass(frozen=True)
class WheelFace(Texture):
    """A wheel from the side: black tyre, spoked or slotted rim, hub."""

    size: int
    seed: int
    rim: float
    """Radius of the rim as a share of half the picture."""
    spokes: int
    metal: Srgb
    fill: float
    """Share of the rim that is metal, 0..1."""

    popularity: ClassVar[float] = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:
        return cls(
            size=size,
            seed=new_seed(rng),
            rim=0.4,
            spokes=choose(rng, [5, 5, 6, 7, 8, 10, 12]),
            metal=shade(uniform(rng, 0.4, 0.85), 0.01, 250.0),
            fill=uniform(rng, 0.35, 0.75),
        )

    def image(self) -> NDArray[np.uint8]:
        rng = np.random.default_rng(self.seed)
        x, y = unit_grid(self.size)
        # Coordinates start in the wheel's middle: the picture is wrapped around it.
        u, v = fraction(x + np.float32(0.5)) * 2 - 1, fraction(y + np.float32(0.5)) * 2 - 1
        radius = np.hypot(u, v) / np.float32(self.rim)
        angle = np.arctan2(v, u) * np.float32(self.spokes / (2 * np.pi))
        spoke = np.abs(fraction(angle) - np.float32(0.5)) < np.float32(self.fill / 2)
        metal = ((radius < 0.95) & (spoke | (radius < 0.3) | (radius > 0.82))).astype(np.float32)
        tyre = np.float32(34) * (1 - np.float32(0.3) * ((radius > 1.2) & (radius < 1.3)))
        picture = mix(np.broadcast_to(tyre, (3, *u.shape)), paint(self.metal), metal)
        return finish(picture, rng, 0.05)

"""Bottles, glasses, cups, plates, vases, jars and candles, and bowls of fruit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part
from scenes.random_draws import choose, new_seed, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, cushion, lathe, rod, surfaces

VESSELS = ("bottle", "tumbler", "wineglass", "cup", "bowl", "plate", "vase", "pot", "jar", "candle")


_VESSEL_SIZE = {
    "bottle": (0.22, 0.32),
    "tumbler": (0.09, 0.14),
    "wineglass": (0.15, 0.22),
    "cup": (0.07, 0.11),
    "bowl": (0.06, 0.1),
    "plate": (0.018, 0.026),
    "vase": (0.15, 0.4),
    "pot": (0.12, 0.22),
    "jar": (0.1, 0.2),
    "candle": (0.08, 0.25),
}


_VESSEL_MADE_OF = {
    "bottle": ("glass", "glass", "plastic"),
    "tumbler": ("glass",),
    "wineglass": ("glass",),
    "cup": ("ceramic",),
    "bowl": ("ceramic", "ceramic", "wood", "glass"),
    "plate": ("ceramic",),
    "vase": ("ceramic", "glass", "metal"),
    "pot": ("chrome", "enamel"),
    "jar": ("glass", "ceramic"),
    "candle": ("wax",),
}


@dataclass(frozen=True)
class Vessel(IndoorShape):
    """A turned thing: bottle, glass, cup, bowl, plate, vase, cooking pot, jar, candle."""

    form: str
    height: float
    slim: float
    """0.8 to 1.25: how wide it is for its height."""
    made_of: str
    lean: float
    """0..1, picks a silhouette within the kind."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls.of(rng, choose(rng, VESSELS))

    @classmethod
    def of(cls, rng: np.random.Generator, kind: str) -> Self:
        """Draw one of a kind (`VESSELS`)."""
        return cls(
            kind,
            uniform(rng, *_VESSEL_SIZE[kind]),
            uniform(rng, 0.85, 1.25),
            choose(rng, _VESSEL_MADE_OF[kind]),
            uniform(rng, 0.0, 1.0),
        )

    def _profile(self) -> list[tuple[float, float]]:
        """(radius, height) relative to the vessel's height, from the foot up the outside and down the inside."""
        a = self.lean
        if self.form == "bottle":
            s = 0.5 + 0.15 * a
            return [
                (0.13, 0.0),
                (0.14, 0.02),
                (0.14, s),
                (0.12, s + 0.1),
                (0.05, s + 0.24),
                (0.045, 0.95),
                (0.055, 0.96),
                (0.055, 1.0),
            ]
        if self.form == "tumbler":
            r = 0.3 + 0.06 * a
            return [(r - 0.05, 0.0), (r, 1.0), (r - 0.025, 1.0), (r - 0.07, 0.08)]
        if self.form == "wineglass":
            r = 0.2 + 0.05 * a
            return [
                (0.2, 0.0),
                (0.19, 0.015),
                (0.025, 0.04),
                (0.02, 0.45),
                (0.12, 0.5),
                (r, 0.7),
                (r - 0.03, 1.0),
                (r - 0.04, 1.0),
                (r - 0.012, 0.7),
                (0.11, 0.52),
            ]
        if self.form == "cup":
            r = 0.42 + 0.08 * a
            return [
                (0.6 * r, 0.0),
                (r - 0.05 * a, 0.3),
                (r, 1.0),
                (r - 0.05, 1.0),
                (r - 0.1, 0.3),
                (0.4 * r, 0.1),
            ]
        if self.form == "bowl":
            r = 0.95 + 0.4 * a
            return [
                (0.5, 0.0),
                (0.55, 0.08),
                (0.8 * r, 0.4),
                (r, 1.0),
                (r - 0.06, 1.0),
                (0.75 * r, 0.45),
                (0.4, 0.14),
            ]
        if self.form == "plate":
            return [(3.0, 0.0), (3.4, 0.25), (5.2, 0.85), (5.3, 1.0), (3.4, 0.45), (3.0, 0.3)]
        if self.form == "vase":
            b = 0.2 + 0.12 * a
            return [
                (0.12, 0.0),
                (b, 0.25 + 0.2 * a),
                (0.1, 0.8),
                (0.13, 1.0),
                (0.11, 1.0),
                (0.08, 0.8),
                (b - 0.03, 0.3 + 0.2 * a),
                (0.1, 0.05),
            ]
        if self.form == "pot":
            r = 0.55 + 0.25 * a
            return [
                (r, 0.0),
                (r + 0.01, 0.05),
                (r + 0.01, 0.8),
                (r + 0.03, 0.82),
                (0.9 * r, 0.88),
                (0.1, 0.92),
                (0.05, 0.93),
                (0.1, 1.0),
            ]
        if self.form == "jar":
            r = 0.34 + 0.1 * a
            return [
                (r - 0.02, 0.0),
                (r, 0.04),
                (r, 0.75),
                (0.75 * r, 0.84),
                (0.78 * r, 0.86),
                (0.78 * r, 1.0),
            ]
        return [
            (0.12 + 0.2 * a, 0.0),
            (0.12 + 0.2 * a, 0.92),
            (0.1 + 0.2 * a, 0.94),
            (0.015, 0.95),
            (0.01, 1.0),
        ]

    def parts(self) -> dict[str, Surface]:
        h = self.height
        body = [lathe([(r * h * self.slim, z * h) for r, z in self._profile()], sides=24)]
        if self.form == "cup":
            r = (0.4 + 0.08 * self.lean) * h * self.slim
            angle = np.linspace(-1.45, 1.45, 9)
            body.append(
                rod(
                    [
                        (r + 0.28 * h * np.cos(t) - 0.05 * h, 0.0, h * (0.55 + 0.3 * np.sin(t)))
                        for t in angle.tolist()
                    ],
                    0.05 * h,
                    6,
                )
            )
        if self.form == "pot":
            r = (0.56 + 0.25 * self.lean) * h * self.slim
            body += [
                rod(
                    (
                        (s * r, -0.15 * h, 0.65 * h),
                        (s * (r + 0.12 * h), 0.0, 0.65 * h),
                        (s * r, 0.15 * h, 0.65 * h),
                    ),
                    0.035 * h,
                    6,
                )
                for s in (-1, 1)
            ]
        if self.form == "bottle":
            r = 0.1415 * h * self.slim
            label = lathe(((r, 0.12 * h), (r, 0.42 * h)), sides=24)
            return surfaces(**{self.made_of: body}, paper_label=[label])
        return surfaces(**{self.made_of: body})


@dataclass(frozen=True)
class FruitBowl(IndoorShape):
    """A bowl with fruit in it."""

    radius: float
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.11, 0.16), new_seed(rng))

    def parts(self) -> dict[str, Surface]:
        rng, r = np.random.default_rng(self.seed), self.radius
        bowl = lathe(
            ((0.5 * r, 0.0), (0.55 * r, 0.01), (r, 0.55 * r), (0.97 * r, 0.55 * r), (0.5 * r, 0.025))
        )
        groups: list[list[Part]] = [[], []]
        for k in range(7):
            a, e = k * 2 * np.pi / 6, rng.uniform(0.27, 0.33) * r
            x, y, z = (
                (0.52 * r * np.cos(a), 0.52 * r * np.sin(a), 0.35 * r) if k < 6 else (0.0, 0.0, 0.62 * r)
            )
            groups[k % 2].append(cushion((x - e, y - e, z, x + e, y + e, z + 1.9 * e), 2.1))
        return surfaces(ceramic=[bowl], fruit=groups[0], fruit_other=groups[1])

"""Screens, keyboards and laptops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.random_draws import chance, integer, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, cushion, fronted, slabs, surfaces


@dataclass(frozen=True)
class Screen(IndoorShape):
    """A monitor or television on a foot, showing something or dark, facing +y."""

    width: float
    lit: bool

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.45, 0.75), chance(rng, 0.55))

    @classmethod
    def television(cls, rng: np.random.Generator) -> Self:
        """A large one."""
        return cls(uniform(rng, 0.9, 1.4), chance(rng, 0.4))

    def parts(self) -> dict[str, Surface]:
        w, h = self.width / 2, 0.57 * self.width
        foot = 0.1 if self.width < 0.8 else 0.05
        body = slabs(
            (-w, -0.025, foot, w, 0.018, foot + h),
            (-0.03, -0.03, 0.0, 0.03, 0.0, foot + 0.1),
            (-0.3 * w - 0.05, -0.1, 0.0, 0.3 * w + 0.05, 0.1, 0.012),
        )
        face = fronted((-w + 0.012, 0.0175, foot + 0.014, w - 0.012, 0.019, foot + h - 0.012))
        return {**surfaces(plastic_black=[body]), "screen lit" if self.lit else "glass black": face}


@dataclass(frozen=True)
class Keyboard(IndoorShape):
    """A keyboard of separate keys, and a mouse beside it; the user is at +y."""

    rows: int
    columns: int
    pitch: float
    """From key to key."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(integer(rng, 5, 6), integer(rng, 13, 20), uniform(rng, 0.018, 0.021))

    def parts(self) -> dict[str, Surface]:
        pitch = self.pitch
        w, d = self.columns * pitch / 2 + 0.008, self.rows * pitch / 2 + 0.008
        keys = []
        for row in range(self.rows):
            y = -d + 0.008 + row * pitch
            column = 0
            while column < self.columns:
                wide = 6 if row == self.rows - 1 and column == 4 else 1
                x = -w + 0.008 + column * pitch
                keys.append(
                    (
                        x + 0.002,
                        y + 0.002,
                        0.014,
                        x + min(wide, self.columns - column) * pitch - 0.002,
                        y + pitch - 0.002,
                        0.021,
                    )
                )
                column += wide
        mouse = cushion((w + 0.06, -0.03, 0.0, w + 0.12, 0.07, 0.035), 2.6)
        return surfaces(plastic=[slabs((-w, -d, 0.0, w, d, 0.015)), mouse], plastic_keys=[slabs(*keys)])


@dataclass(frozen=True)
class Laptop(IndoorShape):
    """An open laptop facing +y."""

    width: float
    angle_deg: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, 0.28, 0.38), uniform(rng, 95.0, 125.0))

    def parts(self) -> dict[str, Surface]:
        w, d = self.width / 2, 0.34 * self.width
        keys = [
            (x, y, 0.0165, x + 0.014, y + 0.014, 0.019)
            for y in np.linspace(-d + 0.03, -d + 0.12, 5).tolist()
            for x in np.linspace(-w + 0.02, w - 0.034, 13).tolist()
        ]
        lean = np.radians(self.angle_deg - 90.0)
        lid = slabs((-w, -0.004, 0.0, w, 0.004, 2 * d))
        face = fronted((-w + 0.008, 0.0035, 0.012, w - 0.008, 0.0045, 2 * d - 0.008))
        turn = np.array([(1, 0, 0), (0, np.cos(lean), -np.sin(lean)), (0, np.sin(lean), np.cos(lean))])
        hinge = np.array((0.0, -d, 0.016))
        shown = Surface(face.vertices @ turn.T + hinge, face.triangles, face.uv)
        return {
            **surfaces(
                metal=[slabs((-w, -d, 0.0, w, d, 0.017)), (lid[0] @ turn.T + hinge, lid[1])],
                plastic_black=[slabs(*keys)],
            ),
            "screen lit": shown,
        }

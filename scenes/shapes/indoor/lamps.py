"""Lamps that stand, and lamps that hang."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part, grid_triangles
from scenes.geometry.polyhedra import outward
from scenes.random_draws import chance, choose, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, lathe, rod, slabs, surfaces


@dataclass(frozen=True)
class Lamp(IndoorShape):
    """A table or floor lamp with a shade, standing on z = 0."""

    height: float
    shade_radius: float
    shade_height: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls.floor(rng) if chance(rng, 0.5) else cls.table(rng)

    @classmethod
    def table(cls, rng: np.random.Generator) -> Self:
        """A lamp for tables and sideboards."""
        return cls(uniform(rng, 0.32, 0.55), uniform(rng, 0.09, 0.16), uniform(rng, 0.12, 0.2))

    @classmethod
    def floor(cls, rng: np.random.Generator) -> Self:
        """A standard lamp."""
        return cls(uniform(rng, 1.35, 1.7), uniform(rng, 0.15, 0.25), uniform(rng, 0.2, 0.32))

    def parts(self) -> dict[str, Surface]:
        r, h, z = self.shade_radius, self.height, self.height - self.shade_height
        foot = lathe(((0.8 * r, 0.0), (0.75 * r, 0.015), (0.012, 0.03), (0.012, z + 0.04), (0.004, z + 0.06)))
        ring = _open_shade(r, z, h)
        bulb = lathe(((0.01, z + 0.04), (0.03, z + 0.07), (0.03, z + 0.09), (0.008, z + 0.12)), sides=12)
        return surfaces(metal=[foot], glow_shade=[ring], glow_bulb=[bulb])


def _open_shade(radius: float, low: float, high: float) -> Part:
    """A conical shade open at both ends: a thin wall all round."""
    profile = np.array(
        [(radius, low), (0.72 * radius, high), (0.72 * radius - 0.004, high), (radius - 0.004, low)]
    )
    theta = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    ring = profile[None, :, :1] * np.stack([np.cos(theta), np.sin(theta)], -1)[:, None, :]
    points = np.concatenate([ring, np.broadcast_to(profile[None, :, 1:], (28, 4, 1))], axis=2)
    vertices = points.reshape(-1, 3)
    return vertices, outward(vertices, grid_triangles(28, 4, wrap_rows=True, wrap_columns=True))


@dataclass(frozen=True)
class CeilingLamp(IndoorShape):
    """A lamp under the ceiling; the anchor is on the ceiling, the lamp below it."""

    form: str
    """pendant, tube, panel or dome."""
    drop: float
    size: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        kind = choose(rng, ["pendant", "tube", "panel", "dome"])
        drop = {"pendant": uniform(rng, 0.5, 0.9), "tube": choose(rng, [0.03, 0.4])}.get(kind, 0.0)
        return cls(
            kind, drop, uniform(rng, 0.16, 0.3) if kind in ("pendant", "dome") else uniform(rng, 0.6, 1.2)
        )

    @property
    def light_below_m(self) -> float:
        """How far below the anchor the light comes from."""
        return self.drop + (0.22 if self.form == "pendant" else 0.1)

    def parts(self) -> dict[str, Surface]:
        s, d = self.size, self.drop
        if self.form == "pendant":
            shade = _open_shade(s, -d - 0.2, -d)
            bulb = lathe(((0.015, -d - 0.02), (0.045, -d - 0.1), (0.03, -d - 0.15)), sides=14)
            cord = [
                rod(((0.0, 0.0, 0.0), (0.0, 0.0, -d - 0.03)), 0.003, 6),
                lathe(((0.05, -0.03), (0.05, 0.0))),
            ]
            # Spokes carry the shade.
            cord += [
                rod(((0.0, 0.0, -d - 0.01), (0.72 * s * x, 0.72 * s * y, -d - 0.005)), 0.003, 5)
                for x, y in ((1, 0), (-0.5, 0.86), (-0.5, -0.86))
            ]
            return surfaces(lacquer_shade=[shade], glow_bulb=[bulb], metal=cord)
        if self.form == "tube":
            half = s / 2 + 0.3
            body = [slabs((-half, -0.06, -d - 0.05, half, 0.06, -d))]
            if d > 0.1:
                body += [
                    rod(((x, 0.0, 0.0), (x, 0.0, -d - 0.02)), 0.003, 5) for x in (-0.7 * half, 0.7 * half)
                ]
            tubes = [
                rod(((-half + 0.03, y, -d - 0.065), (half - 0.03, y, -d - 0.065)), 0.014)
                for y in (-0.03, 0.03)
            ]
            return surfaces(enamel=body, glow_tube=tubes)
        if self.form == "panel":
            half = 0.3
            frame = slabs((-half, -half, -0.03, half, half, 0.0))
            return surfaces(
                enamel=[frame],
                glow_panel=[slabs((-half + 0.02, -half + 0.02, -0.034, half - 0.02, half - 0.02, -0.03))],
            )
        dome = lathe(((s, -0.02), (0.93 * s, -0.06), (0.6 * s, -0.1), (0.02, -0.115)), sides=28)
        return surfaces(glow_dome=[dome], metal=[lathe(((s + 0.01, -0.025), (s + 0.01, 0.0)), sides=28)])

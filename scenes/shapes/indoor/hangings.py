"""What hangs before windows: curtains and blinds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, slab_triangles
from scenes.geometry.polyhedra import hexahedra, outward
from scenes.random_draws import choose, new_seed, uniform
from scenes.shapes.anchored import Surface
from scenes.shapes.indoor.parts import IndoorShape, lathe, rod, slabs, surfaces


@dataclass(frozen=True)
class Curtain(IndoorShape):
    """A pair of gathered curtains on a rod, reaching from z = 0 up; the anchor is in the middle of the window."""

    width: float
    """Of the window."""
    height: float
    drawn: float
    """Share of the window that each side's cloth covers."""
    waves: float
    """Folds per metre."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 1.0, 2.2),
            uniform(rng, 1.4, 2.4),
            uniform(rng, 0.12, 0.5),
            uniform(rng, 7.0, 13.0),
            new_seed(rng),
        )

    def parts(self) -> dict[str, Surface]:
        rng = np.random.default_rng(self.seed)
        w = self.width / 2 + 0.15
        cloth = [self._cloth(rng, side * w, side * (w - self.drawn * 2 * w)) for side in (-1.0, 1.0)]
        top = self.height + 0.02
        bar = [rod(((-w - 0.1, 0.1, top), (w + 0.1, 0.1, top)), 0.012)]
        bar += [rod(((x, 0.0, top), (x, 0.1, top)), 0.008) for x in (-w - 0.02, w + 0.02)]
        bar += [
            lathe(((0.016, -0.02), (0.024, 0.0), (0.016, 0.02)), (x, 0.1, top), 10)
            for x in (-w - 0.1, w + 0.1)
        ]
        return surfaces(fabric_curtain=cloth, metal=bar)

    def _cloth(self, rng: np.random.Generator, outer: float, inner: float) -> Part:
        low, high = min(outer, inner), max(outer, inner)
        columns, rows = max(12, round((high - low) * self.waves * 6)), 6
        x = np.linspace(low, high, columns)
        phase = np.cumsum(rng.uniform(0.7, 1.3, columns)) * 2 * np.pi / 6
        spread = np.linspace(0.6, 1.0, rows)[:, None]
        y = (
            0.1
            + 0.035 * spread * np.sin(phase)[None, :]
            + 0.01 * spread * rng.normal(size=columns).cumsum() / 6
        )
        y = np.clip(y, 0.03, 0.2)
        z = np.linspace(self.height, 0.0, rows)[:, None]
        front = np.stack(np.broadcast_arrays(x[None, :], y, z), -1).reshape(-1, 3)
        back = front - np.array((0.0, 0.004, 0.0))
        vertices = np.concatenate([front, back])
        return vertices, outward(vertices, slab_triangles(rows, columns))


@dataclass(frozen=True)
class Blind(IndoorShape):
    """A venetian, vertical or roller blind in a window; the anchor is at the middle of the window's foot."""

    width: float
    height: float
    form: str
    """slats, vertical or roller."""
    let_down: float
    """Share of the window it covers, 0..1."""
    tilt_deg: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.8, 1.8),
            uniform(rng, 0.9, 1.6),
            choose(rng, ["slats", "vertical", "roller"], [0.55, 0.25, 0.2]),
            uniform(rng, 0.3, 1.0),
            uniform(rng, 10.0, 75.0),
        )

    def parts(self) -> dict[str, Surface]:
        w, h = self.width / 2 - 0.01, self.height
        head = slabs((-w, -0.03, h - 0.045, w, 0.03, h))
        low = h * (1 - self.let_down)
        tilt = np.radians(self.tilt_deg)
        if self.form == "roller":
            return surfaces(
                fabric_blind=[slabs((-w, -0.002, low, w, 0.002, h - 0.03))],
                plastic=[head, slabs((-w, -0.01, low - 0.02, w, 0.01, low))],
            )
        if self.form == "vertical":
            wide = 0.045
            x = np.arange(-w + wide, w - wide, 0.08)
            across = np.stack([np.cos(tilt) * np.ones_like(x), np.sin(tilt) * np.ones_like(x)], -1) * wide
            ends = np.stack([np.stack([x, 0 * x], -1) - across, np.stack([x, 0 * x], -1) + across], 1)
            return surfaces(fabric_blind=[_strips(ends, 0.02, h - 0.045, 2)], plastic=[head])
        z = np.arange(low + 0.03, h - 0.05, 0.03)
        across = np.stack([np.cos(tilt) * np.ones_like(z), np.sin(tilt) * np.ones_like(z)], -1) * 0.0125
        middle = np.stack([0 * z, z], -1)
        ends = np.stack([middle - across, middle + across], 1)
        cords = [rod(((x, 0.0, low), (x, 0.0, h - 0.04)), 0.002, 5) for x in (-0.7 * w, 0.7 * w)]
        foot = slabs((-w, -0.012, low - 0.005, w, 0.012, low + 0.015))
        return surfaces(lacquer_slats=[_strips(ends, -w, w, 0)], plastic=[head, foot, *cords])


def _strips(ends: NDArray[np.float64], low: float, high: float, axis: int) -> Part:
    """Thin slats between two ends of an axis; `ends` (N, 2, 2) are the edges of their sections in the other two."""
    side = ends[:, 1] - ends[:, 0]
    normal = np.stack([-side[:, 1], side[:, 0]], -1)
    normal *= 0.0007 / np.linalg.norm(normal, axis=1, keepdims=True)
    ring = np.stack([ends[:, 0] - normal, ends[:, 1] - normal, ends[:, 1] + normal, ends[:, 0] + normal], 1)
    corners = np.stack([np.insert(ring, axis, at, axis=2) for at in (low, high)], 1)
    return hexahedra(corners.reshape(len(ends), 8, 3))

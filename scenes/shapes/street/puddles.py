"""Puddles: sheets of water of irregular outline that lie on a road along its kerbs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from scenes.geometry.building import Part, joined
from scenes.geometry.polyhedra import loft
from scenes.random_draws import new_seed, uniform
from scenes.shapes.anchored import MetricShape, Surface
from scenes.shapes.street.road import Course, crown_height, sample_course

_CORNERS = 40
_FILM_M = 0.009
"""How high the water's surface is above the road: just above its paint."""


@dataclass(frozen=True)
class Puddles(MetricShape):
    """Level sheets of water on a road, each within one flat piece of its camber."""

    course: Course
    spots: tuple[tuple[float, float, float, float], ...]
    """s, t, half the length and half the width of each, metres."""
    road: tuple[float, float, float]
    """Left edge, right edge and crown of the road below, metres."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        course = sample_course(rng)
        spots = tuple((uniform(rng, 0.0, 40.0), 3.2, uniform(rng, 0.5, 2.0), 0.4) for _ in range(4))
        return cls(course, spots, (4.0, -4.0, 0.03), new_seed(rng))

    def surface(self) -> Surface:
        rng = np.random.default_rng(self.seed)
        return Surface(*joined(*(self._puddle(rng, *spot) for spot in self.spots)))

    def _puddle(self, rng: np.random.Generator, s_m: float, t_m: float, long_m: float, wide_m: float) -> Part:
        angle = np.linspace(0.0, 2 * np.pi, _CORNERS, endpoint=False)
        waves = np.arange(2, 6)[:, None]
        wobble = (
            rng.normal(0.0, 0.35, (4, 1)) / waves * np.cos(waves * angle + rng.uniform(0, 6.28, (4, 1)))
        ).sum(0)
        radius = np.clip(0.75 + wobble, 0.35, 1.0)
        rings = []
        for share, above in ((1.0, -0.02), (1.0, 0.0), (0.97, _FILM_M)):
            s, t = (
                s_m + share * long_m * radius * np.cos(angle),
                t_m + share * wide_m * radius * np.sin(angle),
            )
            height = crown_height(self.road, t) + above
            rings.append(np.column_stack([self.course.point(s, t), height]))
        return loft(np.stack(rings))

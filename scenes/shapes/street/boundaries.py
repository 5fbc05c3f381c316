"""Boundaries of gardens: fences, walls and hedges that follow a street's course."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Triangles, Vertices, joined, struts
from scenes.geometry.polyhedra import boxes
from scenes.random_draws import choose, new_seed, uniform
from scenes.shapes.anchored import MetricShape, Surface
from scenes.shapes.street.road import Course, sample_course
from scenes.shapes.street.roadside_plants import sprays

FENCES = ("railing", "picket", "boards", "mesh", "wall")
_GATES = 0.1
"""Share of the panels that are missing: gates and drives."""


@dataclass(frozen=True)
class Fence(MetricShape):
    """Panels of railings, pickets, boards, wire mesh or low wall along a street."""

    style: str
    course: Course
    from_m: float
    to_m: float
    t_m: float
    height: float
    panel: float
    """Length of a panel, metres."""
    step: float
    """Distance between bars or pickets, metres."""
    seed: int
    gates: bool = True
    """Whether some of the panels are missing."""

    @classmethod
    def sample(cls, rng: np.random.Generator, style: str | None = None, course: Course | None = None) -> Self:
        style = style or choose(rng, FENCES)
        course = course or sample_course(rng)
        low, high, near, wide = {
            "railing": (0.9, 1.4, 0.12, 0.17),
            "picket": (0.8, 1.1, 0.13, 0.18),
            "boards": (1.5, 1.9, 0.15, 0.22),
            "mesh": (1.3, 2.2, 0.2, 0.3),
            "wall": (0.5, 1.2, 0.3, 0.31),
        }[style]
        return cls(
            style=style,
            course=course,
            from_m=course.start_m,
            to_m=course.end_m,
            t_m=uniform(rng, 4.0, 9.0),
            height=uniform(rng, low, high),
            panel=uniform(rng, 2.2, 3.2),
            step=uniform(rng, near, wide),
            seed=new_seed(rng),
        )

    def surface(self) -> Surface:
        rng = np.random.default_rng(self.seed)
        starts = np.arange(self.from_m, self.to_m - self.panel, self.panel)
        if self.gates:
            starts = starts[(rng.random(len(starts)) > _GATES) | (np.arange(len(starts)) == 0)]
        vertices, triangles = self._mesh() if self.style == "mesh" else boxes(*self._boxes())
        count = len(vertices)
        along = (starts[:, None] + vertices[:, 0]).ravel()
        aside = np.tile(self.t_m + vertices[:, 1], len(starts))
        plan = self.course.point(along, aside)
        all_triangles = triangles[None] + count * np.arange(len(starts))[:, None, None]
        return Surface(
            np.column_stack([plan, np.tile(vertices[:, 2], len(starts))]), all_triangles.reshape(-1, 3)
        )

    def _boxes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Low and high corners of one panel's boxes."""
        length, high = self.panel, self.height
        if self.style == "wall":
            low = np.array([(0.0, -0.12, -0.2), (-0.005, -0.16, high)])
            return low, np.array([(length - 0.004, 0.12, high + 0.01), (length - 0.011, 0.16, high + 0.09)])
        count = max(3, int(length / self.step))
        x = 0.05 + np.arange(count) * ((length - 0.05) / count)
        wide = {"railing": 0.022, "picket": 0.075, "boards": 0.9 * length / count}[self.style]
        bars_low = np.stack([x, np.full(count, -0.01), np.full(count, 0.06)], -1)
        bars_high = np.stack([x + wide, np.full(count, 0.01), np.full(count, high)], -1)
        rail_low = np.array([(0.0, 0.009, 0.2), (0.0, 0.009, high - 0.22)])
        rail_high = rail_low + np.array((length - 0.003, 0.035, 0.03 if self.style == "railing" else 0.06))
        post_low, post_high = np.array([(-0.04, -0.045, -0.2)]), np.array([(0.045, 0.045, high + 0.06)])
        return np.concatenate([bars_low, rail_low, post_low]), np.concatenate(
            [bars_high, rail_high, post_high]
        )

    def _mesh(self) -> tuple[Vertices, Triangles]:
        """Thin wires both ways between posts."""
        upright = np.arange(self.step, self.panel, self.step)
        level = np.arange(0.1, self.height, self.step)
        start = [*[(x, 0.0, 0.05) for x in upright], *[(0.0, 0.004, z) for z in level], (0.0, 0.0, -0.2)]
        end = [*[(x, 0.0, self.height) for x in upright], *[(self.panel - 0.003, 0.004, z) for z in level]]
        end.append((0.0, 0.0, self.height + 0.06))
        radius = np.array([*[0.006] * (len(start) - 1), 0.03])
        return struts(np.array(start), np.array(end), radius, radius, 4)


@dataclass(frozen=True)
class Hedge(MetricShape):
    """A clipped or shaggy hedge along a street, with gaps."""

    course: Course
    from_m: float
    to_m: float
    t_m: float
    height: float
    width: float
    leaf: float
    """Length of a spray of leaves, metres."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator, course: Course | None = None) -> Self:
        course = course or sample_course(rng)
        return cls(
            course=course,
            from_m=course.start_m,
            to_m=course.end_m,
            t_m=uniform(rng, 4.0, 9.0),
            height=uniform(rng, 0.7, 1.9),
            width=uniform(rng, 0.5, 0.9),
            leaf=uniform(rng, 0.1, 0.2),
            seed=new_seed(rng),
        )

    def surface(self) -> Surface:
        rng = np.random.default_rng(self.seed)
        wide, high, bush = self.width / 2, self.height, 1.5
        starts = np.arange(self.from_m, self.to_m - bush, bush)
        starts = starts[(rng.random(len(starts)) > _GATES) | (np.arange(len(starts)) == 0)]
        level = high * rng.uniform(0.92, 0.96, len(starts))
        edge = np.full(len(starts), 0.85 * wide)
        low = np.stack([starts, -edge, np.full(len(starts), -0.1)], -1)
        # Neighbouring bushes overlap a little in the street's direction and differ a little in height.
        body = boxes(
            low, np.stack([starts + bush + 0.02, edge - rng.uniform(0.0, 0.02, len(starts)), level], -1)
        )
        count = min(int(70 * bush * len(starts) * (high + wide)), 6000)
        bushes = (len(starts) * rng.random(count) ** 1.6).astype(int)  # the near end is seen best
        face = rng.random(count) * (2 * high + self.width)
        on_top = face > 2 * high
        side = np.where(face > high, 1.0, -1.0)
        y = np.where(on_top, rng.uniform(-wide, wide, count), side * 0.84 * wide)
        z = np.where(on_top, 0.93 * high, face % high)
        x = starts[bushes] + rng.uniform(0.0, bush, count)
        normal = np.stack([np.zeros(count), np.where(on_top, 0.0, side), on_top.astype(float)], -1)
        vertices, triangles = joined(body, sprays(rng, np.stack([x, y, z], -1), normal, self.leaf))
        plan = self.course.point(vertices[:, 0], self.t_m + vertices[:, 1])
        return Surface(np.column_stack([plan, vertices[:, 2]]), triangles)

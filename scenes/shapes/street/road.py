"""Roads: surfaces swept along a winding course, and the markings on them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from scenes.geometry.building import Triangles, Vertices, joined, slab_triangles
from scenes.geometry.polyhedra import boxes, loft, outward
from scenes.random_draws import chance, integer, uniform
from scenes.shapes.anchored import MetricShape, Surface
from scenes.spec import OMIT_DEFAULT, Vector

_STEP_M = 0.5
"""Spacing at which a course's position is tabulated."""


@dataclass(frozen=True)
class Course:
    """A street's centre line: headings at equal steps, smooth between, never turning back on itself.

    Street coordinates are (s, t), as in OpenDRIVE: metres along the line, metres to its left. s = 0 is the
    world's origin, where the heading is that of the x axis, unless `origin` says otherwise.
    """

    start_m: float
    """s of the first heading; negative."""
    spacing_m: float
    headings_deg: tuple[float, ...]
    origin: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0), metadata=OMIT_DEFAULT)
    """World x and y of s = 0, and the heading there in degrees."""

    @classmethod
    def sample(cls, rng: np.random.Generator, start_m: float, end_m: float, bend_deg: float) -> Self:
        """A course over start_m .. end_m whose heading changes by up to `bend_deg` every 50 m."""
        spacing_m = 50.0
        count = 2 + int(np.ceil((end_m - start_m) / spacing_m))
        headings = np.cumsum(rng.uniform(-bend_deg, bend_deg, count))
        # Reflected at +-75 degrees: a street whose x always grows cannot meet itself again.
        headings = 75.0 - np.abs((headings - 75.0) % 300.0 - 150.0)
        return cls(start_m, spacing_m, tuple(float(heading) for heading in headings))

    @property
    def end_m(self) -> float:
        """s of the last heading."""
        return self.start_m + self.spacing_m * (len(self.headings_deg) - 1)

    @cached_property
    def _table(self) -> NDArray[np.float64]:
        """(N, 4) columns s, x, y, heading in radians."""
        knots = self.start_m + self.spacing_m * np.arange(len(self.headings_deg))
        s = np.linspace(knots[0], knots[-1], round(self.spacing_m * (len(knots) - 1) / _STEP_M) + 1)
        heading = np.radians(PchipInterpolator(knots, self.headings_deg)(s))
        at_x, at_y, towards_deg = self.origin
        heading = heading - np.interp(0.0, s, heading) + np.radians(towards_deg)
        step = np.diff(s) / 2
        x = np.concatenate([[0.0], np.cumsum(step * (np.cos(heading[1:]) + np.cos(heading[:-1])))])
        y = np.concatenate([[0.0], np.cumsum(step * (np.sin(heading[1:]) + np.sin(heading[:-1])))])
        return np.stack([s, x - np.interp(0.0, s, x) + at_x, y - np.interp(0.0, s, y) + at_y, heading], -1)

    def heading(self, s_m: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Radians from the x axis towards the y axis."""
        return np.interp(s_m, self._table[:, 0], self._table[:, 3])

    def point(
        self, s_m: NDArray[np.float64] | float, t_m: NDArray[np.float64] | float
    ) -> NDArray[np.float64]:
        """(..., 2) world x, y of a place on the street, or on its straight continuation beyond its ends."""
        s, x, y, _ = self._table.T
        heading = self.heading(s_m)
        beyond = s_m - np.clip(s_m, s[0], s[-1])
        along, aside = np.cos(heading), np.sin(heading)
        return np.stack(
            [
                np.interp(s_m, s, x) + beyond * along - t_m * aside,
                np.interp(s_m, s, y) + beyond * aside + t_m * along,
            ],
            -1,
        )

    def place(self, s_m: float, t_m: float, z_m: float = 0.0) -> Vector:
        """The world point at street coordinates (s, t) and a height."""
        x, y = self.point(s_m, t_m)
        return (float(x), float(y), z_m)

    def facing(self, s_m: float, turn_deg: float = 0.0) -> Rotation:
        """The attitude of something whose x axis is turned from the street's direction by an angle."""
        return Rotation.from_euler("Z", np.degrees(float(self.heading(s_m))) + turn_deg, degrees=True)

    def locate(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2) street coordinates s, t of (N, 2) world points, to about a centimetre near the street."""
        s, x, y, heading = self._table.T
        difference = points[:, None] - np.stack([x, y], -1)[None]
        nearest = (difference**2).sum(-1).argmin(axis=1)
        dx, dy = difference[np.arange(len(points)), nearest].T
        cosine, sine = np.cos(heading[nearest]), np.sin(heading[nearest])
        return np.stack([s[nearest] + dx * cosine + dy * sine, dy * cosine - dx * sine], -1)


def sample_course(rng: np.random.Generator) -> Course:
    """A random course, for shapes that are sampled on their own."""
    return Course.sample(rng, -20.0, uniform(rng, 60.0, 180.0), 25.0)


@dataclass(frozen=True)
class RoadStrip(MetricShape):
    """A slab that follows a course: carriageway, pavement, kerb, verge, river of grass.

    Texture coordinates run along and across the street, in metres.
    """

    course: Course
    from_m: float
    """s where it begins."""
    to_m: float
    left_m: float
    """t of its left edge."""
    right_m: float
    top_m: float
    """Height of its surface."""
    thickness_m: float
    crown_m: float = 0.0
    """How much higher its middle is than its edges."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        course = sample_course(rng)
        half = uniform(rng, 1.0, 6.0)
        return cls(course, course.start_m, course.end_m, half, -half, 0.0, uniform(rng, 0.1, 0.4), 0.05)

    def surface(self) -> Surface:
        count = 2 + int((self.to_m - self.from_m) / 2.0)
        s = np.linspace(self.from_m, self.to_m, count)
        share = np.linspace(0.0, 1.0, 5 if self.crown_m else 2)
        t = self.left_m + share * (self.right_m - self.left_m)
        z = self.top_m + self.crown_m * (4 * share * (1 - share))
        bottom = np.full(2, self.top_m - self.thickness_m)
        across, height = np.concatenate([t, t[[-1, 0]]]), np.concatenate([z, bottom])
        places = self.course.point(s[:, None], across[None, :])
        rings = np.concatenate([places, np.broadcast_to(height[None, :, None], (*places.shape[:2], 1))], -1)
        vertices, triangles = loft(rings)
        along = np.concatenate([np.repeat(s, len(across)), [self.from_m, self.to_m]])
        side = np.tile(across + self.top_m - height, count)
        middle = float(across.mean())
        uv = np.stack([along, np.concatenate([side, [middle, middle]])], -1)
        return Surface(vertices, triangles, uv[triangles])


def crown_height(road: tuple[float, float, float], t_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height above the edges of a road with a left edge, a right edge and a crown (metres), at distances `t_m`."""
    left, right, crown = road
    # A strip is flat between quarter points of its parabola.
    quarter = np.linspace(0.0, 1.0, 5)
    return np.interp((left - t_m) / (left - right), quarter, crown * 4 * quarter * (1 - quarter))


@dataclass(frozen=True)
class Stripe:
    """A painted bar: a rectangle in street coordinates, or a slanted one."""

    from_m: float
    to_m: float
    left_m: float
    right_m: float
    shear: float = 0.0
    """How far the right edge is ahead of the left one, metres."""


@dataclass(frozen=True)
class RoadMarkings(MetricShape):
    """Lane lines, zebra bars, patches of tar: bars a few millimetres thick that follow a course."""

    course: Course
    stripes: tuple[Stripe, ...]
    road: tuple[float, float, float]
    """Left edge, right edge and crown of the road below, metres: paint follows its camber."""
    thickness_m: float = 0.006

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        course = sample_course(rng)
        dash, gap = uniform(rng, 1.0, 4.0), uniform(rng, 1.0, 6.0)
        width = uniform(rng, 0.08, 0.25)
        starts = np.arange(course.start_m, course.end_m - dash, dash + gap)
        stripes = tuple(Stripe(float(s), float(s) + dash, width / 2, -width / 2) for s in starts)
        return cls(course, stripes, (4.0, -4.0, 0.05 if chance(rng, 0.5) else 0.0))

    def surface(self) -> Surface:
        return Surface(*joined(*(self._bar(stripe) for stripe in self.stripes)))

    def _bar(self, stripe: Stripe) -> tuple[Vertices, Triangles]:
        rows = 2 + int((stripe.to_m - stripe.from_m) / 2.0)
        columns = 2 + int((stripe.left_m - stripe.right_m) / 0.7)
        s, t = np.meshgrid(
            np.linspace(stripe.from_m, stripe.to_m, rows),
            np.linspace(stripe.left_m, stripe.right_m, columns),
            indexing="ij",
        )
        s = s + stripe.shear * np.linspace(0.0, 1.0, columns)
        plan = self.course.point(s, t).reshape(-1, 2)
        height = crown_height(self.road, t).ravel()
        vertices = np.concatenate(
            [
                np.column_stack([plan, height + self.thickness_m]),
                np.column_stack([plan, height - 0.02]),
            ]
        )
        return vertices, outward(vertices, slab_triangles(rows, columns))


@dataclass(frozen=True)
class Kerb(MetricShape):
    """Kerb stones laid end to end along a course."""

    course: Course
    from_m: float
    to_m: float
    t_m: float
    """The face towards the road."""
    width_m: float
    """To the left of `t_m`; negative for a kerb on the right."""
    height_m: float
    stone_m: float
    """Length of a stone."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        course = sample_course(rng)
        return cls(
            course,
            course.start_m,
            course.end_m,
            uniform(rng, 2.0, 8.0),
            uniform(rng, 0.1, 0.3),
            uniform(rng, 0.08, 0.16),
            float(integer(rng, 2, 4)),
        )

    def surface(self) -> Surface:
        starts = np.arange(self.from_m, self.to_m - 0.1, self.stone_m)
        low = np.column_stack(
            [np.full(len(starts), 0.006), np.zeros(len(starts)), np.full(len(starts), -0.2)]
        )
        high = np.tile((self.stone_m - 0.006, abs(self.width_m), self.height_m), (len(starts), 1))
        vertices, triangles = boxes(low, high)
        s = np.repeat(starts, 8) + vertices[:, 0]
        t = self.t_m + np.sign(self.width_m) * vertices[:, 1]
        return Surface(
            np.column_stack([self.course.point(s, t), vertices[:, 2]]),
            triangles if self.width_m > 0 else triangles[:, ::-1],
        )


@dataclass(frozen=True)
class LevelGround(MetricShape):
    """Level land along the x axis, a slab a metre thick."""

    from_m: float
    to_m: float
    half_width_m: float
    top_m: float

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(uniform(rng, -300.0, -50.0), uniform(rng, 50.0, 300.0), uniform(rng, 40.0, 200.0), 0.0)

    def surface(self) -> Surface:
        low = np.array((self.from_m, -self.half_width_m, self.top_m - 1.0))
        high = np.array((self.to_m, self.half_width_m, self.top_m))
        return Surface(*boxes(low, high))

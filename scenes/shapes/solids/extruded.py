"""Extruded outlines: stars, gears, plates with holes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from manifold3d import CrossSection, triangulate

from scenes.geometry.building import (
    cross_section,
    extrude_triangles,
    manifold_arrays,
    regular_polygon,
    solid,
)
from scenes.geometry.mesh import Mesh
from scenes.random_draws import chance, integer, log_uniform, uniform
from scenes.spec import Shape


@dataclass(frozen=True)
class ExtrudedStar(Shape):
    """An extruded star or regular polygon, optionally with a hole, twisted and tapered."""

    points: int
    inner_radius: float
    """Radius of the notches relative to the tips; cos(pi / points) makes a regular polygon."""
    hole_radius: float
    """Relative to the notches; 0 for none."""
    height: float
    """Relative to the tips' radius."""
    twist_deg: float
    taper: float
    """Size of the top relative to the bottom."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        twisted = chance(rng, 0.4)
        return cls(
            points=integer(rng, 3, 9),
            inner_radius=uniform(rng, 0.35, 0.95),
            hole_radius=uniform(rng, 0.3, 0.8) if chance(rng, 0.5) else 0.0,
            height=log_uniform(rng, 0.2, 2.5),
            twist_deg=uniform(rng, -120.0, 120.0) if twisted else 0.0,
            taper=uniform(rng, 0.4, 1.0) if chance(rng, 0.4) else 1.0,
        )

    def mesh(self) -> Mesh:
        outline = regular_polygon(2 * self.points)
        outline[1::2] *= self.inner_radius
        contours = [outline]
        if self.hole_radius > 0:
            # The hole must clear the straight edges between tips and notches, not only the notches.
            contours.append(regular_polygon(24, self.hole_radius * self._inscribed_radius()))
        body = cross_section(*contours).extrude(
            self.height, 16 if self.twist_deg else 0, self.twist_deg, (self.taper, self.taper)
        )
        return solid(*manifold_arrays(body))

    def _inscribed_radius(self) -> float:
        """Distance from the centre to the nearest point of the outline."""
        tip = np.array([1.0, 0.0])
        angle = np.pi / self.points
        notch = self.inner_radius * np.array([np.cos(angle), np.sin(angle)])
        edge = notch - tip
        nearest = tip + np.clip(-tip @ edge / (edge @ edge), 0.0, 1.0) * edge
        return float(np.linalg.norm(nearest))


@dataclass(frozen=True)
class Gear(Shape):
    """A toothed wheel with a bore and, if `spokes` is not 0, as many openings between spokes."""

    teeth: int
    tooth_depth: float
    """Relative to the tip radius."""
    bore: float
    """Radius of the hole relative to the tip radius."""
    thickness: float
    """Relative to the tip radius."""
    spokes: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            teeth=integer(rng, 7, 28),
            tooth_depth=uniform(rng, 0.1, 0.28),
            bore=uniform(rng, 0.12, 0.3),
            thickness=log_uniform(rng, 0.12, 0.8),
            spokes=integer(rng, 3, 6) if chance(rng, 0.6) else 0,
        )

    def mesh(self) -> Mesh:
        pitch = 2 * np.pi / self.teeth
        corners = np.array([-0.32, -0.17, 0.17, 0.32]) * pitch
        angle = (np.arange(self.teeth)[:, None] * pitch + corners).ravel()
        root = 1.0 - self.tooth_depth
        radius = np.tile([root, 1.0, 1.0, root], self.teeth)
        outline = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
        wheel = cross_section(outline, regular_polygon(32, self.bore))
        if self.spokes:
            wheel -= self._windows(self.bore + 0.1, root * np.cos(0.36 * pitch) - 0.08)
        return solid(*manifold_arrays(wheel.extrude(self.thickness)))

    def _windows(self, inner: float, outer: float) -> CrossSection:
        """Ring sectors between the spokes."""
        ring = cross_section(regular_polygon(48, outer), regular_polygon(48, inner))
        for k in range(self.spokes):
            spoke = CrossSection.square((1.2, 0.14)).translate((0.0, -0.07))
            ring -= spoke.rotate(360.0 * k / self.spokes)
        return ring


@dataclass(frozen=True)
class HoledPlate(Shape):
    """A sheet with a regular grid of holes: grilles, perforated metal, window frames."""

    columns: int
    rows: int
    hole_corners: int
    """4 for square windows, 24 for round holes."""
    open_share: float
    """Hole diameter relative to the grid's step, 0..1."""
    thickness: float
    """Relative to the grid's step."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        columns = integer(rng, 2, 7)
        return cls(
            columns=columns,
            rows=integer(rng, max(1, columns // 3), columns),
            hole_corners=int(rng.choice([3, 4, 6, 20])),
            open_share=uniform(rng, 0.45, 0.85),
            thickness=log_uniform(rng, 0.1, 1.0),
        )

    def mesh(self) -> Mesh:
        # One cell is triangulated and repeated: cells meet only at their corners, so the plate stays closed.
        square = regular_polygon(4, float(np.sqrt(0.5)), np.pi / 4)
        # Square windows stand upright: their corners, not their sides, are at 45 degrees.
        angle = np.pi / 4 if self.hole_corners == 4 else np.pi / 2
        reach = self.open_share / 2 * (np.sqrt(2.0) if self.hole_corners == 4 else 1.0)
        hole = regular_polygon(self.hole_corners, float(reach), float(angle))
        contours = [square, hole[::-1]]
        cell = np.asarray(triangulate(contours), np.int64)
        corners = np.concatenate(contours)
        column, row = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        centres = np.stack([column.ravel(), row.ravel()], -1).astype(np.float64)
        plan = (centres[:, None] + corners).reshape(-1, 2)
        triangles = cell[None] + len(corners) * np.arange(len(centres))[:, None, None]
        return solid(*extrude_triangles(plan, triangles.reshape(-1, 3), self.thickness))

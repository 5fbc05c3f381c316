"""Thin curved surfaces with a little thickness: folded paper, cloth, ribbons, leaves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Vertices, slab_triangles, solid
from scenes.geometry.mesh import Mesh
from scenes.random_draws import integer, log_uniform, new_seed, uniform
from scenes.shapes.solids.organic import wave_noise
from scenes.spec import Shape


def thickened(
    points: NDArray[np.float64], plan: NDArray[np.float64], thickness: float, *, smooth: bool
) -> Mesh:
    """A closed slab: a sheet of points (R, C, 3) with a thickness along its normals.

    `plan` (R, C, 2) are the texture coordinates of the points.
    """
    rows, columns = points.shape[:2]
    along_rows, along_columns = np.gradient(points, axis=0), np.gradient(points, axis=1)
    normal = np.cross(along_columns, along_rows)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    top = (points + normal * thickness / 2).reshape(-1, 3)
    bottom = (points - normal * thickness / 2).reshape(-1, 3)
    vertices: Vertices = np.concatenate([top, bottom])
    triangles = slab_triangles(rows, columns)
    uv = np.tile(plan.reshape(-1, 2), (2, 1))
    # The underside's vertices lie a little aside in the texture, so that the rim shows some of it.
    uv[rows * columns :] += thickness
    return solid(vertices, triangles, uv=uv[triangles], smooth=smooth)


@dataclass(frozen=True)
class FoldedSheet(Shape):
    """A sheet with sharp parallel folds: screens, corrugated iron, an accordion."""

    folds: int
    fold_deg: float
    """Slope of each panel."""
    aspect: float
    """Length along the folds relative to the sheet's stretched-out width."""
    irregularity: float
    """Relative variation of the panels' widths."""
    thickness: float
    """Relative to a mean panel."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            folds=integer(rng, 2, 14),
            fold_deg=uniform(rng, 20.0, 65.0),
            aspect=uniform(rng, 0.3, 1.2),
            irregularity=uniform(rng, 0.0, 0.6),
            thickness=uniform(rng, 0.03, 0.1),
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        rng = np.random.default_rng(self.seed)
        panels = self.folds + 1
        widths = np.exp(rng.normal(0.0, self.irregularity, panels))
        widths /= widths.sum()
        slopes = np.radians(self.fold_deg) * np.where(np.arange(panels) % 2, -1.0, 1.0)
        x = np.concatenate([[0.0], np.cumsum(widths * np.cos(slopes))])
        z = np.concatenate([[0.0], np.cumsum(widths * np.sin(slopes))])
        s = np.concatenate([[0.0], np.cumsum(widths)])
        y = np.array([-self.aspect / 2, self.aspect / 2])[:, None]
        points = np.stack(np.broadcast_arrays(x, y, z), -1)
        plan = np.stack(np.broadcast_arrays(s, y), -1)
        return thickened(points, plan, self.thickness / panels, smooth=False)


@dataclass(frozen=True)
class Cloth(Shape):
    """A rectangular sheet in soft waves: flags, carpets, crumpled foil."""

    aspect: float
    amplitude: float
    """Standard deviation of the waves relative to half the longer side."""
    frequency: float
    """Lowest wave number, radians per half side."""
    slope: float
    """How fast finer waves become lower."""
    thickness: float
    """Relative to half the longer side."""
    seed: int

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        frequency = log_uniform(rng, 1.5, 5.0)
        return cls(
            aspect=uniform(rng, 0.4, 1.0),
            amplitude=uniform(rng, 0.15, 0.5) / frequency,
            frequency=frequency,
            slope=uniform(rng, 0.8, 2.0),
            thickness=log_uniform(rng, 0.01, 0.03),
            seed=new_seed(rng),
        )

    def mesh(self) -> Mesh:
        rng = np.random.default_rng(self.seed)
        x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-self.aspect, self.aspect, 31))
        plan = np.stack([x, y], -1)
        flat = plan.reshape(-1, 2)
        # All three coordinates move, the sideways ones less, so the outline is not a rectangle either.
        shift = [wave_noise(rng, flat, self.frequency, self.slope).reshape(x.shape) for _ in range(3)]
        sideways = 0.4 * self.amplitude
        points = np.stack([x + sideways * shift[0], y + sideways * shift[1], self.amplitude * shift[2]], -1)
        return thickened(points, plan, self.thickness, smooth=True)


@dataclass(frozen=True)
class Ribbon(Shape):
    """A band wound about an axis, its width turning as it goes: spirals, twisted strips."""

    turns: float
    twist_deg: float
    """How far the band's width turns about its own direction, end to end."""
    pitch: float
    """Rise per turn relative to the radius."""
    width: float
    """Half width relative to the radius."""
    thickness: float
    """Relative to the radius."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        width = uniform(rng, 0.15, 0.4)
        return cls(
            turns=uniform(rng, 0.4, 2.2),
            twist_deg=uniform(rng, -270.0, 270.0),
            pitch=uniform(rng, 0.9, 1.8),
            width=width,
            thickness=uniform(rng, 0.03, 0.08),
        )

    def mesh(self) -> Mesh:
        share = np.linspace(0.0, 1.0, 80)[None, :]
        across = np.linspace(-1.0, 1.0, 7)[:, None]
        angle = 2 * np.pi * self.turns * share
        twist = np.radians(self.twist_deg) * share
        reach = 1.0 + across * self.width * np.sin(twist)
        rise = self.pitch * self.turns * share + across * self.width * np.cos(twist)
        points = np.stack(np.broadcast_arrays(reach * np.cos(angle), reach * np.sin(angle), rise), -1)
        length = share * self.turns * np.hypot(2 * np.pi, self.pitch)
        plan = np.stack(np.broadcast_arrays(length, across * self.width), -1)
        return thickened(points, plan, self.thickness, smooth=True)

"""Wheels of vehicles, and the arches for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from manifold3d import Manifold, Mesh64

from scenes.geometry.building import Part, joined, manifold_arrays, revolve
from scenes.geometry.polyhedra import outward
from scenes.random_draws import integer, uniform
from scenes.shapes.anchored import MetricShape, Surface

MIRROR_M = 0.12
"""How far door mirrors stand out of the body."""


def without_arches(body: Part, axles: tuple[float, ...], wheel_radius: float, width: float) -> Part:
    """The body with a tunnel for each pair of wheels."""
    solid = Manifold(Mesh64(np.ascontiguousarray(body[0]), np.ascontiguousarray(body[1].astype(np.uint64))))
    arch = Manifold.cylinder(width + 1.0, wheel_radius * 1.16, circular_segments=28, center=True)
    for axle in axles:
        solid -= arch.rotate((90.0, 0.0, 0.0)).translate((axle, 0.0, wheel_radius))
    return manifold_arrays(solid)


@dataclass(frozen=True)
class Wheel(MetricShape):
    """A wheel about the y axis, its origin in its middle: tyre, recessed rim, hub.

    Texture coordinates are those of a picture of its side, whose rim unrolls onto the tread.
    """

    radius: float
    width: float
    rim: float
    """Radius of the rim relative to the wheel."""
    sides: int = 24

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        return cls(
            uniform(rng, 0.28, 0.5), uniform(rng, 0.18, 0.26), uniform(rng, 0.6, 0.72), integer(rng, 12, 28)
        )

    def surface(self) -> Surface:
        r, w, rim = self.radius, self.width / 2, self.rim * self.radius
        # Radius and distance from the middle plane, from the hub outwards.
        half = [
            (0.0, 0.62 * w),
            (0.18 * rim, 0.62 * w),
            (0.22 * rim, 0.5 * w),
            (0.9 * rim, 0.58 * w),
            (0.95 * rim, 0.9 * w),
            (1.04 * rim, 0.93 * w),
            (0.93 * r, w),
            (r, 0.8 * w),
        ]
        profile = np.array([*half, (r, 0.0), *[(a, -b) for a, b in half[::-1]]])
        vertices, triangles = revolve(profile[:, 0], profile[:, 1], self.sides)
        tread = np.clip(0.8 * w - np.abs(vertices[:, 2]), 0.0, None)
        tread[np.hypot(vertices[:, 0], vertices[:, 1]) < 0.9 * r] = 0.0
        plan = vertices[:, :2] * (1 + tread / r)[:, None]
        # Revolved about z; the axle is y.
        axle_y = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], -1)
        triangles = outward(axle_y, triangles)
        return Surface(axle_y, triangles, plan[triangles])


@dataclass(frozen=True)
class WheelSet(MetricShape):
    """All wheels of a vehicle that stands still, in the coordinates of the vehicle."""

    wheel: Wheel
    places: tuple[tuple[float, float], ...]
    """x and y of each."""

    smooth: ClassVar[bool] = True

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:
        x, y = uniform(rng, 1.1, 1.5), uniform(rng, 0.7, 0.9)
        return cls(Wheel.sample(rng), ((x, y), (x, -y), (-x, y), (-x, -y)))

    def surface(self) -> Surface:
        one = self.wheel.surface()
        hubs = [np.array((x, y, self.wheel.radius)) for x, y in self.places]
        vertices, triangles = joined(*((one.vertices + hub, one.triangles) for hub in hubs))
        assert one.uv is not None
        return Surface(vertices, triangles, np.tile(one.uv, (len(hubs), 1, 1)))

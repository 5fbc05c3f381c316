"""Shapes made to measure: cars, houses, lamp posts, whose parameters are metres.

Every other shape is a form without a size, which the sampler scales at will. These have the size they have:
`standing` puts one into the world by its own origin (the point of the ground it stands on) instead of by the
middle of its bounding box.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.geometry.building import Triangles, Vertices, joined, solid
from scenes.geometry.mesh import Mesh
from scenes.motion.trajectories import quaternion, vector
from scenes.spec import Quaternion, SceneObject, Shape, Trajectory, Vector


@dataclass(frozen=True)
class Surface:
    """A closed surface in metres, z up, its origin where the thing stands."""

    vertices: Vertices
    """(V, 3), metres."""
    triangles: Triangles
    """(F, 3)."""
    uv: NDArray[np.float64] | None = None
    """(F, 3, 2) texture coordinates, about metres; None for a box mapping."""


@dataclass(frozen=True)
class MetricShape(Shape):
    """A shape with a size. Its mesh fills the cube as every mesh does, but its texture coordinates are in
    metres, so that things of different sizes can share a material."""

    popularity: ClassVar[float] = 0.0
    smooth: ClassVar[bool] = False
    """Whether shading normals are interpolated, except across creases."""

    @abstractmethod
    def surface(self) -> Surface:
        """Build the closed surface in metres."""

    @cached_property
    def _built(self) -> tuple[Mesh, NDArray[np.float64], float]:
        surface = self.surface()
        low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        half_m = float((high - low).max()) / 2
        mesh = solid(surface.vertices, surface.triangles, uv=surface.uv, smooth=self.smooth)
        metric = replace(mesh, corner_uv=mesh.corner_uv * np.float32(half_m))
        return metric, (low + high) / 2, half_m

    def mesh(self) -> Mesh:
        return self._built[0]

    @property
    def half_extent_m(self) -> float:
        """Half the longest side of the bounding box: the scale at which the shape has its own size."""
        return self._built[2]

    @cached_property
    def half_box_m(self) -> NDArray[np.float64]:
        """(3,) half the sides of the bounding box."""
        half: NDArray[np.float64] = np.abs(self.mesh().vertices).max(axis=0) * self.half_extent_m
        return half

    @property
    def middle_m(self) -> NDArray[np.float64]:
        """(3,) the middle of the bounding box, seen from the shape's origin."""
        return self._built[1]


def standing(
    name: str,
    shape: MetricShape,
    material: int,
    positions_m: Sequence[Vector],
    rotations: Sequence[Rotation],
    times_frames: Sequence[float] = (0.0,),
) -> SceneObject:
    """A made-to-measure shape with its origin at the given place, or moving through the given key poses."""
    middle = shape.middle_m
    places: list[Vector] = [
        vector(np.array(position) + rotation.apply(middle))
        for position, rotation in zip(positions_m, rotations, strict=True)
    ]
    turns: list[Quaternion] = [quaternion(rotation) for rotation in rotations]
    motion = Trajectory(tuple(times_frames), tuple(places), tuple(turns))
    half = shape.half_extent_m
    return SceneObject(name, shape, material, motion, (half, half, half))


_CUBE_CORNERS = np.array([(x, y, z) for z in (0, 1) for y, x in ((0, 0), (0, 1), (1, 1), (1, 0))], np.float64)
_CUBE_TRIANGLES = np.array(
    [
        *((0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)),
        *((0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)),
    ],
    np.int64,
)


def boxes(low_m: NDArray[np.float64], high_m: NDArray[np.float64]) -> tuple[Vertices, Triangles]:
    """Upright boxes between opposite corners (N, 3) each."""
    low_m, high_m = np.atleast_2d(low_m), np.atleast_2d(high_m)
    corners = low_m[:, None] + _CUBE_CORNERS * (high_m - low_m)[:, None]
    return hexahedra(corners)


def hexahedra(corners: NDArray[np.float64]) -> tuple[Vertices, Triangles]:
    """Six-faced bodies (N, 8, 3): the corners around one face, then those opposite them, either way round."""
    local = corners - corners[:, :1]
    a, b, c = (local[:, _CUBE_TRIANGLES[:, k]] for k in range(3))
    inside_out = np.einsum("nfi,nfi->n", a, np.cross(b, c)) < 0
    faces = np.where(inside_out[:, None, None], _CUBE_TRIANGLES[:, ::-1], _CUBE_TRIANGLES)
    triangles = faces + 8 * np.arange(len(corners))[:, None, None]
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)


def loft(rings: NDArray[np.float64]) -> tuple[Vertices, Triangles]:
    """A closed surface over rings (R, N, 3) of corresponding points, its ends closed by fans."""
    count, sides = rings.shape[:2]
    index = np.arange(count * sides).reshape(count, sides)
    a, b = index[:-1], np.roll(index, -1, axis=1)[:-1]
    c, d = np.roll(index, -1, axis=1)[1:], index[1:]
    walls = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3)
    middles = np.stack([rings[0].mean(axis=0), rings[-1].mean(axis=0)])
    first, following = index[0], np.roll(index[0], -1)
    last, last_following = index[-1], np.roll(index[-1], -1)
    hubs = count * sides + np.zeros(sides, np.int64)
    caps = np.concatenate(
        [np.stack([hubs, following, first], -1), np.stack([hubs + 1, last, last_following], -1)]
    )
    vertices, triangles = np.concatenate([rings.reshape(-1, 3), middles]), np.concatenate([walls, caps])
    return vertices, outward(vertices, triangles)


def outward(vertices: Vertices, triangles: Triangles) -> Triangles:
    """The triangles of one closed body, turned so that they run counter-clockwise seen from outside."""
    a, b, c = (vertices[triangles[:, k]] - vertices[0] for k in range(3))
    return triangles if np.einsum("ij,ij->", a, np.cross(b, c)) > 0 else triangles[:, ::-1]


def merged(*parts: tuple[Vertices, Triangles]) -> Surface:
    """Several closed surfaces as one, box mapped."""
    return Surface(*joined(*parts))


def turned(part: tuple[Vertices, Triangles], yaw_deg: float, offset_m: Vector) -> tuple[Vertices, Triangles]:
    """A part turned about the vertical axis, then moved."""
    rotation = Rotation.from_euler("Z", yaw_deg, degrees=True)
    return rotation.apply(part[0]) + np.array(offset_m), part[1]

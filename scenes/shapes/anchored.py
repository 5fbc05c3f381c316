"""Anchored shapes: shapes built about a point that stands on the ground, not about their middle.

A mesh always fills the cube [-1, 1]^3 about its middle (`scenes.spec.Shape`). An anchored shape is built in
coordinates of its own, z up, whose origin is its anchor: the point of the ground it stands on, or the point
it hangs from. Its `frame` tells how the mesh lies in those coordinates, which is all that placing it by its
anchor takes (`scenes.placement.assembly.anchored_object`).

There are two kinds. A `PartedShape` has no size of its own and consists of named parts, each with a material
of its own. A `MetricShape` has measures and texture coordinates in metres.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, Triangles, Vertices, joined, solid
from scenes.geometry.mesh import Mesh
from scenes.spec import Shape
from stereoforge_kit.errors import InputError


@dataclass(frozen=True)
class Surface:
    """A closed surface in built coordinates: z up, the anchor at the origin."""

    vertices: Vertices
    """(V, 3)."""
    triangles: Triangles
    """(F, 3)."""
    uv: NDArray[np.float64] | None = None
    """(F, 3, 2) texture coordinates, in the unit of the vertices; None for a box mapping."""


@dataclass(frozen=True)
class Frame:
    """How a mesh lies in the coordinates its shape was built in: built = mesh * half_extent + centre."""

    centre: NDArray[np.float64]
    """(3,) where the mesh's origin is."""
    half_extent: float
    """Built units per mesh unit: half the longest side of the bounding box."""
    low: NDArray[np.float64]
    """(3,) lower corner of the bounding box, in built coordinates."""
    high: NDArray[np.float64]
    """(3,) upper corner of the bounding box, in built coordinates."""

    @classmethod
    def about(cls, vertices: Vertices) -> Frame:
        """The frame of the mesh that is made from built vertices (V, 3)."""
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        return cls((low + high) / 2, float((high - low).max()) / 2, low, high)

    @property
    def factor(self) -> float:
        """Mesh units per built unit."""
        return 1.0 / self.half_extent

    def mesh_scale_m(self, unit_m: float) -> float:
        """Length of a mesh unit in metres, where a built unit is `unit_m` long."""
        # Shapes in metres get their exact size: dividing by the factor would round twice.
        return self.half_extent if unit_m == 1.0 else unit_m / self.factor


@dataclass(frozen=True)
class AnchoredShape(Shape):
    """A shape that is placed by its anchor, the origin of the coordinates it is built in."""

    smooth: ClassVar[bool] = False
    """Whether shading normals are interpolated."""
    crease_deg: ClassVar[float | None] = 50.0
    """Where they are, edges sharper than this stay sharp; None where there are none."""

    @abstractmethod
    def surface(self) -> Surface:
        """Build the closed surface in built coordinates."""

    def mesh(self) -> Mesh:
        return self._finished(self.surface())

    @property
    def frame(self) -> Frame:
        """How the mesh lies in built coordinates."""
        return Frame.about(self.surface().vertices)

    def _finished(self, surface: Surface) -> Mesh:
        return solid(
            surface.vertices,
            surface.triangles,
            uv=surface.uv,
            smooth=self.smooth,
            crease_deg=self.crease_deg,
        )


@lru_cache(maxsize=192)
def _parts_of(shape: PartedShape) -> dict[str, Part]:
    """The parts of a shape; kept for a while, because placing it and building each part ask again."""
    parts = shape.parts()
    for vertices, triangles in parts.values():
        vertices.flags.writeable = triangles.flags.writeable = False
    return parts


@dataclass(frozen=True)
class PartedShape(AnchoredShape):
    """An anchored shape without a size of its own, made of closed named parts.

    Two records that differ only in `only` are parts of one thing: placed at one spot they fit together.
    """

    only: str = field(default="", kw_only=True)
    """Name of the one part to build; empty for all of them."""

    @abstractmethod
    def parts(self) -> dict[str, Part]:
        """Build every part: its vertices (V, 3) and triangles (F, 3) in built coordinates, by name."""

    def part_names(self) -> tuple[str, ...]:
        """Names of all parts, whatever `only` says."""
        return tuple(_parts_of(replace(self, only="")))

    def surface(self) -> Surface:
        """The surface of the part `only` names, or of all. Raises ValueError for a part it does not have."""
        parts = _parts_of(replace(self, only=""))
        if not self.only:
            return Surface(*joined(*parts.values()))
        if self.only not in parts:
            raise InputError(f"a {type(self).__name__} has no part {self.only!r}: {', '.join(parts)}")
        return Surface(*parts[self.only])


@dataclass(frozen=True)
class MetricShape(AnchoredShape):
    """An anchored shape that has a size: cars, houses, lamp posts.

    Its parameters are metres, and so are its texture coordinates, so that things of different sizes can
    share a material. The mesh fills the cube as every mesh does; scaled by `frame.half_extent` it has its
    own size.
    """

    popularity: ClassVar[float] = 0.0
    crease_deg: ClassVar[float | None] = 40.0

    @cached_property
    def _built(self) -> tuple[Mesh, Frame]:
        """Mesh and frame from one surface; kept, because a street asks for both many times."""
        surface = self.surface()
        mesh, frame = self._finished(surface), Frame.about(surface.vertices)
        return replace(mesh, corner_uv=mesh.corner_uv * np.float32(frame.half_extent)), frame

    def mesh(self) -> Mesh:
        return self._built[0]

    @property
    def frame(self) -> Frame:
        return self._built[1]


def frame_of(shape: Shape) -> Frame:
    """The frame of any shape; one that is not anchored stands on the lowest point of its mesh."""
    # A metric shape keeps its frame, and its mesh, only as long as it lives itself.
    return shape.frame if isinstance(shape, MetricShape) else _frame_of(shape)


@lru_cache(maxsize=256)
def _frame_of(shape: Shape) -> Frame:
    if isinstance(shape, AnchoredShape):
        return shape.frame
    vertices = shape.mesh().vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    foot = np.array((0.0, 0.0, low[2]))
    return Frame(-foot, 1.0, low - foot, high - foot)

"""Shapes that stand on something: built about a foot of their own, in parts that may wear different things."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Triangles, Vertices, fit_to_cube, joined, solid
from scenes.geometry.mesh import Mesh
from scenes.spec import Shape

Part = tuple[Vertices, Triangles]


@dataclass(frozen=True)
class Frame:
    """How a mesh lies in the coordinates its shape was built in: built = mesh / factor + centre."""

    centre: NDArray[np.float64]
    """(3,) where the mesh's origin is."""
    factor: float
    """Mesh units per built unit."""
    low: NDArray[np.float64]
    """(3,) lower corner of the bounding box, as built."""
    high: NDArray[np.float64]
    """(3,) upper corner."""


@lru_cache(maxsize=48)
def _parts_of(shape: PartedShape) -> dict[str, Part]:
    """A shape's parts, kept for a while: placing a thing, and building each of its parts, asks again."""
    parts = shape.parts()
    for vertices, triangles in parts.values():
        vertices.flags.writeable = triangles.flags.writeable = False
    return parts


@dataclass(frozen=True)
class PartedShape(Shape):
    """A shape built with its foot at the origin and z up, out of closed named parts.

    Two records that differ only in `only` are parts of one thing: placed by their frames they fit together.
    """

    only: str = field(default="", kw_only=True)
    """Name of the one part to build; empty for all of them."""

    smooth: ClassVar[bool] = False
    """Whether it is shaded smoothly."""
    crease_deg: ClassVar[float | None] = 50.0
    """Where it is, edges sharper than this stay sharp; None where there are none."""

    @abstractmethod
    def parts(self) -> dict[str, Part]:
        """Every part by name, in built coordinates."""

    def part_names(self) -> tuple[str, ...]:
        return tuple(_parts_of(replace(self, only="")))

    def surface(self) -> Part:
        """What this record asks for. Raises ValueError for a part it does not have."""
        parts = _parts_of(replace(self, only=""))
        if not self.only:
            return joined(*parts.values())
        if self.only not in parts:
            raise ValueError(f"a {type(self).__name__} has no part {self.only!r}: {', '.join(parts)}")
        return parts[self.only]

    def mesh(self) -> Mesh:
        vertices, triangles = self.surface()
        return solid(vertices, triangles, smooth=self.smooth, crease_deg=self.crease_deg)

    def frame(self) -> Frame:
        vertices, _ = self.surface()
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        return Frame((low + high) / 2, fit_to_cube(vertices)[1], low, high)

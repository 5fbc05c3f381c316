"""The parts of indoor shapes, and the building blocks they are made from.

Measures are metres. The anchor is on the floor, z up. What stands at a wall has its back at y = 0 and its front
towards +y; what stands free is centred on the anchor. x is the width, centred.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.building import Part, joined, revolve, struts, tube
from scenes.geometry.polyhedra import boxes, outward
from scenes.shapes.anchored import Frame, MetricShape, Surface
from scenes.shapes.solids.basic import cube_grid
from stereoforge_kit.errors import InputError

BoxCorners = tuple[float, float, float, float, float, float]
"""x, y, z of the lower corner and of the upper one."""

_BEHIND_M = 2e-4
"""How far faces that would coincide are apart."""


@dataclass(frozen=True)
class Top:
    """A level rectangle that things can stand on, in the coordinates of the shape it belongs to."""

    low: tuple[float, float]
    high: tuple[float, float]
    z: float
    headroom: float
    """How tall a thing on it may be."""


@lru_cache(maxsize=96)
def _parts_of(shape: IndoorShape) -> dict[str, Surface]:
    """The parts of a shape; kept for a while, because placing it and building each part ask again."""
    return shape.parts()


@dataclass(frozen=True)
class IndoorShape(MetricShape):
    """A metric shape of closed named parts, each with a material of its own.

    The first word of a part's name says what the part is made of (`scenes.appearance.room_materials`). Two
    records that differ only in `only` are parts of one thing: placed at one spot they fit together.
    """

    only: str = field(default="", kw_only=True)
    """Name of the one part to build; empty for all of them."""

    smooth: ClassVar[bool] = True

    @abstractmethod
    def parts(self) -> dict[str, Surface]:
        """Build every part in built coordinates, by name."""

    def tops(self) -> tuple[Top, ...]:
        """Where things can stand on it."""
        return ()

    @property
    def frame(self) -> Frame:
        return self._frame

    @cached_property
    def _frame(self) -> Frame:
        """Found without building the mesh, since a room is measured far oftener than it is built."""
        return Frame.about(self.surface().vertices)

    def part_names(self) -> tuple[str, ...]:
        """Names of all parts, whatever `only` says."""
        return tuple(_parts_of(replace(self, only="")))

    def surface(self) -> Surface:
        """The surface of the part `only` names, or of all. Raises ValueError for a part it does not have."""
        parts = _parts_of(replace(self, only=""))
        if not self.only:
            return Surface(*joined(*((part.vertices, part.triangles) for part in parts.values())))
        if self.only not in parts:
            raise InputError(f"a {type(self).__name__} has no part {self.only!r}: {', '.join(parts)}")
        return parts[self.only]


def surfaces(**parts: Part | Sequence[Part]) -> dict[str, Surface]:
    """Named parts, each box mapped, from one body or several; parts without a body are left out.

    An underscore in a name stands for a space: `wood_legs` is the part "wood legs".
    """
    made = {}
    for name, bodies in parts.items():
        several: Sequence[Part] = [bodies] if isinstance(bodies, tuple) else bodies
        if several:
            made[name.replace("_", " ")] = Surface(*joined(*several))
    return made


def slabs(*corners: BoxCorners) -> Part:
    """Axis-aligned boxes; a face that would coincide with another box's, facing the same way, lies a little behind it.

    Where two faces coincide, each shades the other, and Cycles renders them black.
    """
    array = np.array(corners)
    low, high = array[:, :3].copy(), array[:, 3:].copy()
    for box in range(1, len(array)):
        for axis, ends, inwards in (
            (k, ends, way) for k in range(3) for ends, way in ((low, 1.0), (high, -1.0))
        ):
            others = [k for k in range(3) if k != axis]
            meets = (low[:box, others] < high[box, others] - 1e-6) & (
                high[:box, others] > low[box, others] + 1e-6
            )
            taken = ends[:box, axis][meets.all(axis=1)]
            while (np.abs(taken - ends[box, axis]) < 0.5 * _BEHIND_M).any():
                ends[box, axis] += inwards * _BEHIND_M
    return boxes(low, high)


def lathe(
    profile: Sequence[tuple[float, float]], at: tuple[float, float, float] = (0.0, 0.0, 0.0), sides: int = 20
) -> Part:
    """The body of revolution of (radius, height) points, upright at a place; closed on its axis at both ends."""
    points = np.array([(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])])
    vertices, triangles = revolve(points[:, 0], points[:, 1], sides)
    return vertices + np.array(at), outward(vertices, triangles)


def rod(path: Sequence[tuple[float, float, float]], radius: float, sides: int = 8) -> Part:
    """A round rod along a path."""
    points = np.array(path)
    if len(points) == 2:
        radii = np.array([radius])
        return struts(points[:1], points[1:], radii, radii, sides)
    vertices, triangles, _ = tube(points, np.full(len(points), radius), sides)
    return vertices, triangles


@lru_cache(maxsize=4)
def _rounded_cube(cells: int, power: float) -> Part:
    vertices, triangles = cube_grid(cells)
    gauge = (np.abs(vertices) ** power).sum(axis=1) ** (1 / power)
    return vertices / gauge[:, None], outward(vertices, triangles)


def cushion(corners: BoxCorners, power: float = 6.0) -> Part:
    """A padded block in a box; the larger the power, the squarer it is."""
    low, high = np.array(corners[:3]), np.array(corners[3:])
    vertices, triangles = _rounded_cube(6, power)
    return (low + high) / 2 + vertices * (high - low) / 2, triangles


def fronted(corners: BoxCorners) -> Surface:
    """A thin upright box whose face towards y shows a whole picture once."""
    vertices, triangles = slabs(corners)
    low, high = np.array(corners[:3]), np.array(corners[3:])
    uv: NDArray[np.float64] = ((vertices - low) / (high - low))[:, [0, 2]]
    return Surface(vertices, triangles, uv[triangles])


def legs(
    x: float, y: float, height: float, thickness: float, *, tapered: bool = False, inset: float = 0.0
) -> list[Part]:
    """Four square legs at the corners (+-x, +-y), standing on z = 0."""
    half = thickness / 2
    if tapered:
        return [
            lathe(((0.6 * half, 0.0), (half, height)), (sx * (x - inset), sy * (y - inset), 0.0), 10)
            for sx in (-1, 1)
            for sy in (-1, 1)
        ]
    return [
        slabs(
            *(
                (
                    sx * (x - inset) - half,
                    sy * (y - inset) - half,
                    0.0,
                    sx * (x - inset) + half,
                    sy * (y - inset) + half,
                    height,
                )
                for sx in (-1, 1)
                for sy in (-1, 1)
            )
        )
    ]


def moved(part: Part, offset: tuple[float, float, float]) -> Part:
    """A part at another place."""
    return part[0] + np.array(offset), part[1]

"""Putting a scene together: materials that are shared, things made of several objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from scenes.shapes.metric import MetricShape, standing
from scenes.shapes.street.road import Course
from scenes.spec import Material, SceneObject

Thing = tuple[SceneObject, ...]
"""The objects that make up one thing and are kept or left out together."""


@dataclass
class Assembly:
    """What has been put into a scene so far."""

    materials: list[Material] = field(default_factory=list)
    things: list[Thing] = field(default_factory=list)
    _places: dict[Material, int] = field(default_factory=dict)

    def material(self, material: Material) -> int:
        """The index of a material; equal ones are stored once."""
        if material not in self._places:
            self._places[material] = len(self.materials)
            self.materials.append(material)
        return self._places[material]

    def add(self, *objects: SceneObject) -> None:
        self.things.append(objects)


def by_the_street(
    name: str,
    parts: Sequence[tuple[str, MetricShape, int]],
    course: Course,
    s_m: float,
    t_m: float,
    *,
    turn_deg: float = 0.0,
    z_m: float = 0.0,
) -> Thing:
    """A thing of several parts (name, shape, material) that stands at a place of the street."""
    position, rotation = course.place(s_m, t_m, z_m), course.facing(s_m, turn_deg)
    return tuple(
        standing(f"{name} {part}".rstrip(), shape, material, [position], [rotation])
        for part, shape, material in parts
    )

"""Assembling a scene: shared materials, shapes placed by their anchors, things made of several objects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.motion.trajectories import quaternion, vector
from scenes.shapes.anchored import frame_of
from scenes.spec import Deformation, Material, SceneObject, Shape, Trajectory, Vector

ObjectGroup = tuple[SceneObject, ...]
"""The objects that make up one thing and are kept or left out together."""
GroupParts = Sequence[tuple[str, Shape, int]]
"""Name, shape and material index of each part of a thing."""


class Assembly:
    """The materials and things of a scene so far."""

    def __init__(self) -> None:
        self.materials: list[Material] = []
        self.groups: list[ObjectGroup] = []
        self._indices: dict[Material, int] = {}

    @property
    def objects(self) -> tuple[SceneObject, ...]:
        """All objects in the order in which they were added."""
        return tuple(item for group in self.groups for item in group)

    def material(self, material: Material) -> int:
        """The index of a material; equal ones are stored once."""
        if material not in self._indices:
            self._indices[material] = len(self.materials)
            self.materials.append(material)
        return self._indices[material]

    def add(self, *objects: SceneObject) -> None:
        """Add the objects that make up one thing."""
        self.groups.append(objects)


def anchored_object(
    name: str,
    shape: Shape,
    material: int,
    positions_m: Sequence[Vector | NDArray[np.float64]],
    rotations: Sequence[Rotation],
    times_frames: Sequence[float] = (0.0,),
    *,
    unit_m: float = 1.0,
    deformation: Deformation | None = None,
) -> SceneObject:
    """An object whose anchor is at the given places (world, metres), turned by the given rotations.

    `positions_m`, `rotations` and `times_frames` have one entry for each key pose; one entry is a static
    object. `unit_m` is the length of one unit of the shape's built coordinates, 1 for metric shapes. Raises
    ValueError for sequences of different lengths.
    """
    frame = frame_of(shape)
    centre = frame.centre * unit_m
    places = tuple(
        vector(np.asarray(position) + rotation.apply(centre))
        for position, rotation in zip(positions_m, rotations, strict=True)
    )
    turns = tuple(quaternion(rotation) for rotation in rotations)
    scale = frame.mesh_scale_m(unit_m)
    motion = Trajectory(tuple(times_frames), places, turns)
    return SceneObject(name, shape, material, motion, (scale, scale, scale), deformation)


def anchored_group(name: str, parts: GroupParts, position_m: Vector, rotation: Rotation) -> ObjectGroup:
    """A static thing of several metric parts that share one anchor."""
    return tuple(
        anchored_object(f"{name} {part}".rstrip(), shape, material, [position_m], [rotation])
        for part, shape, material in parts
    )

"""The triangles of a Scene at any instant, built from its record without Blender."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from datagen.errors import DatasetError
from scenes import Scene
from scenes.geometry.mesh import Mesh
from scenes.spec import SceneObject, Shape


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """The meshes of a scene's objects and where their vertices are; made by `build_geometry`."""

    scene: Scene
    meshes: tuple[Mesh, ...]
    """In the order of `Scene.objects`; objects of equal shape share one."""
    triangles: NDArray[np.int32]
    """(T, 3) indices into the vertices of all objects together."""
    owners: NDArray[np.int32]
    """(T,) index in `Scene.objects` of the object that each triangle belongs to."""
    materials: NDArray[np.int32]
    """(T,) index in `Scene.materials` of each triangle's material."""

    def local_vertices(self, index: int, time_frames: float) -> NDArray[np.float64]:
        """(V, 3) vertices of one object at an instant, deformed, in the mesh's own coordinates."""
        deformation = self.scene.objects[index].deformation
        vertices = self.meshes[index].vertices
        return vertices if deformation is None else deformation.deformed(vertices, time_frames)

    def vertices(
        self, time_frames: float, to_frame: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """(V, 3) vertices of all objects at an instant, in metres.

        to_frame: A (4, 4) matrix from the world to the frame of reference asked for; None for the world.
        """
        placed = [np.zeros((0, 3))]
        for index, thing in enumerate(self.scene.objects):
            pose = thing.pose(time_frames)
            pose = pose if to_frame is None else to_frame @ pose
            placed.append(self.local_vertices(index, time_frames) @ pose[:3, :3].T + pose[:3, 3])
        return np.concatenate(placed)


def build_geometry(scene: Scene) -> SceneGeometry:
    """Build the meshes of a scene's objects, each distinct shape once.

    Raises DatasetError for an object with fewer materials than its mesh has slots for.
    """
    built: dict[Shape, Mesh] = {}
    for thing in scene.objects:
        if thing.shape not in built:
            built[thing.shape] = thing.shape.mesh()
    meshes = tuple(built[thing.shape] for thing in scene.objects)
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    triangles = np.concatenate(
        [np.zeros((0, 3), np.int32)]
        + [mesh.triangles + np.int32(start) for mesh, start in zip(meshes, first, strict=False)]
    )
    owners = np.repeat(np.arange(len(meshes), dtype=np.int32), [len(mesh.triangles) for mesh in meshes])
    materials = np.concatenate(
        [np.zeros(0, np.int32)]
        + [_materials_of(thing, mesh) for thing, mesh in zip(scene.objects, meshes, strict=True)]
    )
    return SceneGeometry(scene, meshes, triangles, owners, materials)


def _materials_of(thing: SceneObject, mesh: Mesh) -> NDArray[np.int32]:
    """(F,) index in `Scene.materials` of each triangle. Raises DatasetError for slots that the object has none for."""
    if mesh.slots is None:
        return np.full(len(mesh.triangles), thing.material, np.int32)
    if not len(thing.materials) > mesh.slots.max(initial=0):
        raise DatasetError(
            f"object {thing.name!r} has {len(thing.materials)} materials for {mesh.slots.max() + 1} slots of its mesh"
        )
    return np.array(thing.materials, np.int32)[mesh.slots]

"""The triangles Blender renders, modifiers and instances included."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray


def evaluated_triangles() -> NDArray[np.float64]:
    """(T, 3, 3) world coordinates of every triangle corner in the open file at its current state.

    Read from the evaluated dependency graph with the matrices Blender itself uses (32-bit), so that a ray
    cast on them sees the same surfaces as the render.
    """
    graph = bpy.context.evaluated_depsgraph_get()
    corners_of: dict[int, NDArray[np.float64]] = {}
    """By the address of the evaluated mesh, which instances share."""
    pieces = [np.empty((0, 3, 3))]
    for instance in graph.object_instances:
        if instance.object.type != "MESH" or not instance.show_self:
            continue
        mesh, matrix = instance.object.data, np.array(instance.matrix_world, np.float64)
        if mesh.as_pointer() not in corners_of:
            corners_of[mesh.as_pointer()] = _local_corners(mesh)
        pieces.append(corners_of[mesh.as_pointer()] @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(pieces)


def _local_corners(mesh: bpy.types.Mesh) -> NDArray[np.float64]:
    """(T, 3, 3) the corners of a mesh's triangles in its own coordinates."""
    mesh.calc_loop_triangles()
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", vertices)
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    return vertices.reshape(-1, 3).astype(np.float64)[corners].reshape(-1, 3, 3)

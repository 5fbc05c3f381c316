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
    pieces = [
        _instance_triangles(instance.object.data, np.array(instance.matrix_world, np.float64))
        for instance in graph.object_instances
        if instance.object.type == "MESH" and instance.show_self
    ]
    return np.concatenate(pieces) if pieces else np.empty((0, 3, 3))


def _instance_triangles(mesh: bpy.types.Mesh, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    mesh.calc_loop_triangles()
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", vertices)
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    points = vertices.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return points[corners].reshape(-1, 3, 3)

"""Disparity of a Scene by casting rays at its meshes: without Blender, to check what Blender rendered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from datagen.ground_truth import RectifiedPair
from datagen.layout import Eye
from scenes import Scene


@dataclass(frozen=True)
class Hits:
    """What the rays through some pixels' centres meet first."""

    disparity: NDArray[np.float64]
    """(N,) pixels; 0 where nothing is hit."""
    object_index: NDArray[np.int64]
    """(N,) 0 where nothing is hit, else 1 + index in `Scene.objects`."""


class SceneRayCaster:
    """Casts rays from either eye at the triangles of a scene.

    Meshes are built once; they stand in the left eye's frame, where 32 bits lose least.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._meshes = [thing.shape.mesh() for thing in scene.objects]
        first_vertex = np.cumsum([0, *(len(mesh.vertices) for mesh in self._meshes)])
        self._triangles = np.concatenate(
            [np.zeros((0, 3), np.int32)]
            + [mesh.triangles + first for mesh, first in zip(self._meshes, first_vertex, strict=False)]
        ).astype(np.int32)
        """(T, 3) indices into the vertices of all meshes."""
        self._owners = np.repeat(np.arange(len(self._meshes)), [len(mesh.triangles) for mesh in self._meshes])
        self._instant: float | None = None

    def cast(self, eye: Eye, time_frames: float, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Hits:
        """First hits through the centres of the pixels (rows, columns), both (N,).

        Embree finds the triangle in 32 bits; the distance to its plane is then computed in 64 bits.
        """
        camera = self._scene.camera
        pair = RectifiedPair(camera.width, camera.height, camera.focal_px, camera.baseline_m)
        directions = pair.rays()[rows, columns]
        origin = np.array([0.0 if eye == "left" else camera.baseline_m, 0.0, 0.0])
        disparity, index = np.zeros(len(directions)), np.zeros(len(directions), np.int64)
        if not len(self._triangles):
            return Hits(disparity, index)
        if time_frames != self._instant:
            self._place(time_frames)
        origins = np.broadcast_to(origin, directions.shape).astype(np.float32)
        hit = np.asarray(
            self._embree.run(origins, directions.astype(np.float32), query="INTERSECT"), np.int64
        )
        met = hit >= 0
        corners = self._vertices[self._triangles[hit[met]]] - origin
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # depth = n.v / n.r with a ray r of unit length along the axis, and disparity = fB / depth.
        along = np.einsum("ij,ij->i", normals, directions[met])
        disparity[met] = camera.disparity_metres * along / np.einsum("ij,ij->i", normals, corners[:, 0])
        index[met] = 1 + self._owners[hit[met]]
        return Hits(disparity, index)

    def _place(self, time_frames: float) -> None:
        """Put all triangles where they are at an instant."""
        to_left_eye = np.linalg.inv(self._scene.camera.pose("left", time_frames))
        poses = [to_left_eye @ thing.pose(time_frames) for thing in self._scene.objects]
        moved = [
            mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
            for mesh, pose in zip(self._meshes, poses, strict=True)
        ]
        self._vertices = np.concatenate(moved)
        self._embree = EmbreeScene(robust=True)
        TriangleMesh(self._embree, self._vertices.astype(np.float32), self._triangles)
        self._instant = time_frames

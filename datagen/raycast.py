"""Disparity of a Scene by casting rays at its meshes: without Blender, to check what Blender rendered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from datagen.ground_truth import RectifiedPair, to_camera_frame
from datagen.layout import Eye
from scenes import Scene
from scenes.mesh import Mesh


@dataclass(frozen=True)
class Hits:
    """What the rays through some pixels' centres meet first."""

    disparity: NDArray[np.float64]
    """(N,) pixels; 0 where nothing is hit."""
    object_index: NDArray[np.int64]
    """(N,) 0 where nothing is hit, else 1 + index in `Scene.objects`."""


class SceneRayCaster:
    """Casts rays from either eye at the triangles of a scene, whose meshes are built once."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        camera = scene.camera
        self._pair = RectifiedPair(camera.width, camera.height, camera.focal_px, camera.baseline_m)
        self._meshes: list[Mesh] = [thing.shape.mesh() for thing in scene.objects]
        self._owners = np.repeat(np.arange(len(self._meshes)), [len(mesh.triangles) for mesh in self._meshes])

    def cast(self, eye: Eye, time_frames: float, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Hits:
        """First hits through the centres of the pixels (rows, columns), both (N,).

        Embree finds the triangle in 32 bits; the distance to its plane is then computed in 64 bits.
        """
        directions = self._pair.rays()[rows, columns]
        disparity, index = np.zeros(len(directions)), np.zeros(len(directions), np.int64)
        if not len(self._owners):
            return Hits(disparity, index)
        triangles = to_camera_frame(self._triangles(time_frames), self._scene.camera.pose(eye, time_frames))
        embree = EmbreeScene(robust=True)
        # Kept in a name: the mesh must live as long as the rays are cast.
        geometry = TriangleMesh(embree, triangles.astype(np.float32))
        origins = np.zeros_like(directions, np.float32)
        hit = np.asarray(embree.run(origins, directions.astype(np.float32), query="INTERSECT"), np.int64)
        del geometry
        met = hit >= 0
        corners = triangles[hit[met]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # depth = n.v / n.r with a ray r of unit length along the axis, and disparity = fB / depth.
        inverse_depth = np.einsum("ij,ij->i", normals, directions[met]) / np.einsum(
            "ij,ij->i", normals, corners[:, 0]
        )
        disparity[met] = self._scene.camera.disparity_metres * inverse_depth
        index[met] = 1 + self._owners[hit[met]]
        return Hits(disparity, index)

    def _triangles(self, time_frames: float) -> NDArray[np.float64]:
        """(T, 3, 3) corners of all objects' triangles in the world at an instant."""
        corners = []
        for thing, mesh in zip(self._scene.objects, self._meshes, strict=True):
            pose = thing.pose(time_frames)
            corners.append((mesh.vertices @ pose[:3, :3].T + pose[:3, 3])[mesh.triangles])
        return np.concatenate(corners)

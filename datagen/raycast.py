"""Disparity of a Scene by casting rays at its meshes: without Blender, to check what Blender rendered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from datagen.ground_truth import OCCLUDED, OUT_OF_FRAME, SAME_SURFACE, VISIBLE, RectifiedPair
from datagen.layout import Eye
from datagen.scene_geometry import SceneGeometry

_FAR = 1e30


@dataclass(frozen=True)
class Hits:
    """What the rays through some pixels' centres meet first."""

    disparity: NDArray[np.float64]
    """(N,) pixels; 0 where nothing is hit."""
    object_index: NDArray[np.int64]
    """(N,) 0 where nothing is hit, else 1 + index in `Scene.objects`."""
    occlusion: NDArray[np.uint8]
    """(N,) 0 visible, 1 occluded, 2 out of the other frame."""


class SceneRayCaster:
    """Casts rays from either eye at the triangles of a scene.

    Meshes are built once; they stand in the left eye's frame, where 32 bits lose least.
    """

    def __init__(self, geometry: SceneGeometry) -> None:
        self._geometry = geometry
        self._scene = geometry.scene
        self._instant: float | None = None

    def cast(self, eye: Eye, time_frames: float, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Hits:
        """First hits through the centres of the pixels (rows, columns), both (N,).

        Embree finds the triangle in 32 bits; the distance to its plane is then computed in 64 bits.
        """
        camera = self._scene.camera
        pair = RectifiedPair(camera.width, camera.height, camera.focal_px, camera.baseline_m)
        directions = pair.rays()[rows, columns]
        disparity, index = np.zeros(len(directions)), np.zeros(len(directions), np.int64)
        hidden = np.zeros(len(directions), bool)
        if len(self._geometry.triangles):
            if time_frames != self._instant:
                self._place(time_frames)
            eyes = np.array([0.0, 0.0, 0.0]), np.array([camera.baseline_m, 0.0, 0.0])
            own, other = eyes if eye == "left" else eyes[::-1]
            disparity, index = self._first_hits(own, directions)
            hidden = self._hidden(own, other, directions, disparity)
        x_other = columns + 0.5 + (-disparity if eye == "left" else disparity)
        outside = (x_other < 0) | (x_other > camera.width)
        labels = np.where(outside, OUT_OF_FRAME, np.where(hidden, OCCLUDED, VISIBLE))
        return Hits(disparity, index, labels.astype(np.uint8))

    def _first_hits(
        self, origin: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        hit = self._run(origin, directions, "INTERSECT", np.full(len(directions), _FAR))
        met = hit >= 0
        corners = self._vertices[self._geometry.triangles[hit[met]]] - origin
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # depth = n.v / n.r with a ray r of unit length along the axis, and disparity = fB / depth.
        along = np.einsum("ij,ij->i", normals, directions[met])
        disparity, index = np.zeros(len(hit)), np.zeros(len(hit), np.int64)
        distance = np.einsum("ij,ij->i", normals, corners[:, 0])
        disparity[met] = self._scene.camera.disparity_metres * along / distance
        index[met] = 1 + self._geometry.owners[hit[met]]
        return disparity, index

    def _hidden(
        self,
        own: NDArray[np.float64],
        other: NDArray[np.float64],
        directions: NDArray[np.float64],
        disparity: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Whether something stands between the other eye and what is seen; the sky is in the same direction
        from both eyes."""
        sky = disparity == 0
        depth = self._scene.camera.disparity_metres / np.where(sky, 1.0, disparity)
        towards = np.where(sky[:, None], directions, own + depth[:, None] * directions - other)
        return self._run(other, towards, "OCCLUDED", np.where(sky, _FAR, 1 - SAME_SURFACE)) == 0

    def _run(
        self,
        origin: NDArray[np.float64],
        directions: NDArray[np.float64],
        query: str,
        reach: NDArray[np.float64],
    ) -> NDArray[np.int64]:
        """What Embree answers for rays from one point; `reach` is in lengths of their directions."""
        origins = np.broadcast_to(origin, directions.shape).astype(np.float32)
        answer = self._embree.run(
            origins, directions.astype(np.float32), dists=reach.astype(np.float32), query=query
        )
        return np.asarray(answer, np.int64)

    def _place(self, time_frames: float) -> None:
        """Put all triangles where they are at an instant."""
        to_left_eye = np.linalg.inv(self._scene.camera.pose("left", time_frames))
        self._vertices = self._geometry.vertices(time_frames, to_left_eye)
        self._embree = EmbreeScene(robust=True)
        TriangleMesh(self._embree, self._vertices.astype(np.float32), self._geometry.triangles)
        self._instant = time_frames

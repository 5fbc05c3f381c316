"""Ground truth of a Scene by casting rays at its meshes: disparity, object index and occlusion, exact at pixel centres.

Blender renders the same meshes, but its depth pass would not be exact: it keeps the first sample of Cycles, which is
off the pixel's centre by some 5e-4 px, and has 32 bits. That is enough to miss leaves and wires.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from datagen.dataset.layout import View
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME, VISIBLE
from datagen.ground_truth.labels import SAME_SURFACE
from datagen.ground_truth.scene_geometry import SceneGeometry

_FAR = 1e30


@dataclass(frozen=True)
class Hits:
    """What the rays through the centres of N pixels hit first."""

    disparity: NDArray[np.float64]
    """(N,) pixels; that of infinity (`StereoCamera.disparity_at_infinity`) where nothing is hit."""
    object_index: NDArray[np.int64]
    """(N,) 0 where nothing is hit, else 1 + index in `Scene.objects`."""
    material_index: NDArray[np.int64]
    """(N,) 0 where nothing is hit, else 1 + index in `Scene.materials`."""
    occlusion: NDArray[np.uint8]
    """(N,) 0 visible, 1 occluded, 2 out of the other frame."""


@dataclass(frozen=True)
class SurfacePoints:
    """The points of triangles that the rays through the centres of N pixels hit first."""

    triangle: NDArray[np.int64]
    """(N,) row of `SceneGeometry.triangles`, -1 where nothing is hit."""
    weights: NDArray[np.float64]
    """(N, 3) barycentric coordinates of the ray's intersection with the triangle's plane; 0 where nothing is hit."""


class SceneRayCaster:
    """Casts rays from either camera at the triangles of a scene.

    The triangles are kept in the left camera's frame, where 32-bit floats lose least. They are placed anew when another
    instant is asked for.
    """

    def __init__(self, geometry: SceneGeometry) -> None:
        self.geometry = geometry
        self._scene = geometry.scene
        self._instant: float | None = None

    def cast(self, view: View, time_frames: float, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Hits:
        """The first hits of the rays through the centres of the pixels (rows, columns), both (N,).

        Embree finds the triangle with 32-bit floats. The distance to its plane is then computed with 64 bits.
        """
        directions, camera = self.directions(view, rows, columns), self._scene.camera
        inverse_depth = np.zeros(len(directions))
        index, material = np.zeros((2, len(directions)), np.int64)
        if len(self.geometry.triangles):
            self._place(time_frames)
            own, other = self._camera_centres(view)
            inverse_depth, hit = self._first_hits(own, directions)
            index = np.where(hit >= 0, 1 + self.geometry.owners[hit], 0)
            material = np.where(hit >= 0, 1 + self.geometry.materials[hit], 0)
        disparity = camera.disparity_metres * inverse_depth + camera.disparity_at_infinity
        x_other = columns + 0.5 + (-disparity if view == "left" else disparity)
        inside = (x_other >= 0) & (x_other <= camera.width)
        labels = np.where(inside, VISIBLE, OUT_OF_FRAME).astype(np.uint8)
        if len(self.geometry.triangles):
            occluded = self._is_occluded(own, other, directions[inside], inverse_depth[inside])
            labels[inside] = np.where(occluded, OCCLUDED, VISIBLE)
        return Hits(disparity, index, material, labels)

    def coarse_pixels(self, across: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns (N,) of a regular grid over the image, with about `across` pixels in a row."""
        camera = self._scene.camera
        step = max(1, camera.width // across)
        grid = np.mgrid[step // 2 : camera.height : step, step // 2 : camera.width : step]
        return grid[0].ravel(), grid[1].ravel()

    def cast_all(self, view: View, time_frames: float) -> Hits:
        """The first hits of the rays through the centres of all pixels; each field is (H, W)."""
        shape = (self._scene.camera.height, self._scene.camera.width)
        rows, columns = np.indices(shape).reshape(2, -1)
        hits = self.cast(view, time_frames, rows, columns)
        return Hits(
            hits.disparity.reshape(shape),
            hits.object_index.reshape(shape),
            hits.material_index.reshape(shape),
            hits.occlusion.reshape(shape),
        )

    def surface_points(
        self, view: View, time_frames: float, rows: NDArray[np.intp], columns: NDArray[np.intp]
    ) -> SurfacePoints:
        """The surface points that the pixels (rows, columns), both (N,), show at their centres."""
        directions = self.directions(view, rows, columns)
        triangle, weights = np.full(len(directions), -1, np.int64), np.zeros((len(directions), 3))
        if len(self.geometry.triangles):
            self._place(time_frames)
            own, _ = self._camera_centres(view)
            triangle = self._nearest(own, directions)
            met = triangle >= 0
            a, b, c = np.moveaxis(self._vertices[self.geometry.triangles[triangle[met]]] - own, 1, 0)
            ray = directions[met]
            # Of a ray r from the origin through a triangle a, b, c: det(r, b, c) and its rotations.
            parts = [np.einsum("ij,ij->i", ray, np.cross(*pair)) for pair in ((b, c), (c, a), (a, b))]
            weights[met] = np.stack(parts, -1) / np.sum(parts, axis=0)[:, None]
        return SurfacePoints(triangle, weights)

    def shows_back(
        self, time_frames: float, rows: NDArray[np.intp], columns: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """(N,) True where a pixel of the left view shows the back of a triangle, whose corners run clockwise there."""
        points, directions = (
            self.surface_points("left", time_frames, rows, columns),
            self.directions("left", rows, columns),
        )
        back = points.triangle >= 0
        a, b, c = np.moveaxis(self._vertices[self.geometry.triangles[points.triangle[back]]], 1, 0)
        back[back] = np.einsum("ij,ij->i", np.cross(b - a, c - a), directions[back]) > 0
        return back

    def directions(
        self, view: View, rows: NDArray[np.intp], columns: NDArray[np.intp]
    ) -> NDArray[np.float64]:
        """(N, 3) directions through the pixels' centres in the camera's frame, of length 1 along the optical axis."""
        camera = self._scene.camera
        center_x, center_y = camera.principal_point(view)
        x = (columns + 0.5 - center_x) / camera.focal_px
        y = -(rows + 0.5 - center_y) / camera.focal_y_px
        return np.stack([x, y, np.full_like(x, -1.0)], axis=-1)

    def _camera_centres(self, view: View) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The centres of this view's camera and of the other one, in the left camera's frame."""
        left, right = np.zeros(3), np.array([self._scene.camera.baseline_m, 0.0, 0.0])
        return (left, right) if view == "left" else (right, left)

    def _nearest(self, origin: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.int64]:
        """(N,) the triangle that each ray hits first, -1 for none."""
        return self._run(origin, directions, "INTERSECT", np.full(len(directions), _FAR))

    def _first_hits(
        self, origin: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """1 / depth (N,) in 1/m, 0 where nothing is hit, and the triangle (N,) hit first, -1 for none."""
        hit = self._nearest(origin, directions)
        met = hit >= 0
        # Far fewer triangles are visible than there are pixels: compute the plane of each once.
        seen = np.zeros(len(self.geometry.triangles), bool)
        seen[hit[met]] = True
        place = (np.cumsum(seen) - 1)[hit[met]]
        planes = self._inverse_depth_planes(np.flatnonzero(seen), origin)
        inverse_depth = np.zeros(len(hit))
        inverse_depth[met] = np.einsum("ij,ij->i", planes[place], directions[met])
        return inverse_depth, hit

    def _inverse_depth_planes(
        self, triangles: NDArray[np.intp], origin: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(K, 3) a vector p for each triangle: a ray r of length 1 along the axis hits its plane at 1 / depth = p.r."""
        corners = self._vertices[self.geometry.triangles[triangles]] - origin
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # depth = n.v / n.r.
        distance = np.einsum("ij,ij->i", normals, corners[:, 0])
        planes: NDArray[np.float64] = normals / distance[:, None]
        return planes

    def _is_occluded(
        self,
        own: NDArray[np.float64],
        other: NDArray[np.float64],
        directions: NDArray[np.float64],
        inverse_depth: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """(N,) True where something stands between the other camera and the point.

        The sky is in the same direction from both cameras.
        """
        sky = inverse_depth == 0
        towards = directions / np.where(sky, 1.0, inverse_depth)[:, None]
        towards[~sky] += own - other
        return self._run(other, towards, "OCCLUDED", np.where(sky, _FAR, 1 - SAME_SURFACE)) == 0

    def _run(
        self,
        origin: NDArray[np.float64],
        directions: NDArray[np.float64],
        query: str,
        reach: NDArray[np.float64],
    ) -> NDArray[np.int64]:
        """Embree's answer for rays from one point. `reach` is in lengths of their directions."""
        origins = np.broadcast_to(origin, directions.shape).astype(np.float32)
        answer = self._embree.run(
            origins, directions.astype(np.float32), dists=reach.astype(np.float32), query=query
        )
        return np.asarray(answer, np.int64)

    def _place(self, time_frames: float) -> None:
        """Place all triangles as they are at an instant."""
        if time_frames == self._instant:
            return
        to_left_camera = np.linalg.inv(self._scene.camera.pose("left", time_frames))
        self._vertices = self.geometry.vertices(time_frames, to_left_camera)
        self._embree = EmbreeScene(robust=True)
        TriangleMesh(self._embree, self._vertices.astype(np.float32), self.geometry.triangles)
        self._instant = time_frames

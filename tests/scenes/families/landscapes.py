"""What tests of the landscape families look at: where things are at an instant, and what the left view shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import SceneGeometry
from scenes.spec import Scene


@dataclass(frozen=True)
class FirstHits:
    """First hits of the rays through the pixels' centres of the left view."""

    disparity_960: NDArray[np.float64]
    """(H, W) disparity in pixels of an image 960 pixels wide, 0 for the sky."""
    index: NDArray[np.int64]
    """(H, W) object index, -1 for the sky."""


def first_hits(scene: Scene, geometry: SceneGeometry, time_frames: float = 0.0) -> FirstHits:
    camera = scene.camera
    rows, columns = np.divmod(np.arange(camera.height * camera.width), camera.width)
    hits = SceneRayCaster(geometry).cast("left", time_frames, rows, columns)
    shape = (camera.height, camera.width)
    return FirstHits(
        (hits.disparity * 960 / camera.width).reshape(shape), hits.object_index.reshape(shape) - 1
    )


def world_vertices(geometry: SceneGeometry, index: int, time_frames: float) -> NDArray[np.float64]:
    """(V, 3) of one object, deformed and placed."""
    pose = geometry.scene.objects[index].pose(time_frames)
    vertices: NDArray[np.float64] = geometry.local_vertices(index, time_frames) @ pose[:3, :3].T + pose[:3, 3]
    return vertices


def nearest_m(geometry: SceneGeometry, time_frames: float, view: str) -> float:
    """Distance from a view's camera to the nearest triangle of anything."""
    position = geometry.scene.camera.pose(view, time_frames)[:3, 3]
    corners = geometry.vertices(time_frames)[geometry.triangles]
    # Only triangles whose bounding ball comes near are worth the exact distance.
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    gap = np.linalg.norm(centre - position, axis=1) - radius
    likely = np.argsort(gap)[:2000]
    closest = trimesh.triangles.closest_point(corners[likely], np.tile(position, (len(likely), 1)))
    return float(np.linalg.norm(closest - position, axis=1).min())


def ground_below(geometry: SceneGeometry, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) height of the ground's triangles under (N, 3) points, by rays from high above; object 0 is the
    ground."""
    mesh = geometry.meshes[0]
    vertices = world_vertices(geometry, 0, 0.0)
    ground = trimesh.Trimesh(vertices, mesh.triangles, process=False)
    origins = points * (1.0, 1.0, 0.0) + (0.0, 0.0, vertices[:, 2].max() + 1.0)
    down = np.tile((0.0, 0.0, -1.0), (len(points), 1))
    hits, ray, _ = ground.ray.intersects_location(origins, down, multiple_hits=False)
    height = np.full(len(points), np.nan)
    height[ray] = hits[:, 2]
    return height


def heights_of_feet(geometry: SceneGeometry, indices: list[int], time_frames: float) -> NDArray[np.float64]:
    """(N,) how far each object is above the ground, relative to its size: the least of its lowest tenth.

    Not that of its lowest vertex, which on a slope may be the end of a bough that hangs over lower ground.
    """
    heights = []
    for index in indices:
        vertices = world_vertices(geometry, index, time_frames)
        low, high = vertices[:, 2].min(), vertices[:, 2].max()
        lowest = vertices[vertices[:, 2] <= low + 0.1 * (high - low)]
        above = lowest[:, 2] - ground_below(geometry, lowest)
        heights.append(above.min() / np.ptp(vertices, axis=0).max())
    return np.array(heights)


def encloses(geometry: SceneGeometry, index: int, point: NDArray[np.float64], time_frames: float) -> float:
    """How often a closed surface encloses a point: van Oosterom and Strackee 1983."""
    corners = world_vertices(geometry, index, time_frames)[geometry.meshes[index].triangles] - point
    a, b, c = (corners[:, k] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    determinant = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float((2 * np.arctan2(determinant, below)).sum() / (4 * np.pi))

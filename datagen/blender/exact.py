"""Properties that decide geometry: Blender keeps them as they are set, or the scene is refused.

Blender clamps what it does not like without a word: a resolution to 4 px, a lens to 1 mm. The picture would then show
another scene than the ground truth.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from datagen.errors import DatasetError
from datagen.ground_truth.scene_geometry import SceneGeometry

FLOAT32 = 1e-6
"""Relative error of a property of Blender."""
NEAR_M, FAR_M = 1e-3, 1e7
"""Clip planes of ordinary scenes."""
CARE_M = 10 * NEAR_M
"""A surface nearer than this moves the near plane; a pixel's depth may be a few times less than its distance."""


def set_exactly(owner: Any, name: str, value: float) -> None:
    """Set a property of a Blender object and read it back. Raises DatasetError if Blender made another value of it."""
    setattr(owner, name, value)
    kept = getattr(owner, name)
    if not math.isclose(kept, value, rel_tol=FLOAT32):
        raise DatasetError(f"Blender cannot render a {name} of {value:g}: it makes {kept:g} of it")


def clip_planes(
    geometry: SceneGeometry, camera: NDArray[np.float64], time_frames: float
) -> tuple[float, float]:
    """The near and the far plane, in metres, between which everything is that a camera can see.

    Args:
        geometry: Of the scene.
        camera: (3,) the camera's position in the world.
        time_frames: The instant.
    """
    near, far = math.inf, 0.0
    for index, thing in enumerate(geometry.scene.objects):
        pose = thing.pose(time_frames)
        vertices = geometry.local_vertices(index, time_frames) @ pose[:3, :3].T + pose[:3, 3] - camera
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        far = max(far, float(np.linalg.norm(np.maximum(np.abs(low), np.abs(high)))))
        if (low < CARE_M).all() and (high > -CARE_M).all():
            near = min(near, _nearest(vertices[geometry.meshes[index].triangles]))
    return NEAR_M if near >= CARE_M else near / 10, max(FAR_M, 2 * far)


def _nearest(corners: NDArray[np.float64]) -> float:
    """The distance of the origin from triangles (T, 3, 3), infinite where it is certainly more than `CARE_M`."""
    close = (corners.min(axis=1) < CARE_M).all(axis=1) & (corners.max(axis=1) > -CARE_M).all(axis=1)
    corners = corners[close]
    if not len(corners):
        return math.inf
    points = trimesh.triangles.closest_point(corners, np.zeros((len(corners), 3)))
    return float(np.linalg.norm(points, axis=1).min())

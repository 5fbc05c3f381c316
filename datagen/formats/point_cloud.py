"""Coloured points as binary PLY, which MeshLab, CloudCompare, Blender and Open3D read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from stereoforge_kit.files import write_bytes


def write_point_cloud(path: Path | str, points: NDArray[np.floating[Any]], colors: NDArray[np.uint8]) -> None:
    """Write points with their colours.

    Args:
        path: The file, `.ply`.
        points: (N, 3) metres, finite.
        colors: (N, 3) uint8 sRGB.

    Raises FormatError for arrays of other shapes, no points, or points that are not finite.

    >>> import tempfile, trimesh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "points.ply"
    ...     write_point_cloud(path, np.array([[0, 0, 5.0]]), np.uint8([[9, 8, 7]]))
    ...     cloud = trimesh.load(path)
    >>> cloud.vertices.tolist(), cloud.colors.tolist()
    ([[0.0, 0.0, 5.0]], [[9, 8, 7, 255]])
    """
    path = Path(path)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise FormatError(f"{path}: points are (N, 3) numbers, at least one, not {points.shape}")
    if colors.shape != points.shape:
        raise FormatError(f"{path}: {len(points)} points have as many colours, not {colors.shape}")
    if not np.isfinite(points).all():
        raise FormatError(f"{path}: points must be finite")
    import trimesh  # here, since refining without a calibration writes no points

    cloud = trimesh.PointCloud(points.astype(np.float32), colors=colors)
    write_bytes(path, cloud.export(file_type="ply"))

"""Points as a model that the page's viewer turns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from stereoforge_kit.files import write_bytes

MOST_POINTS = 150_000
"""What a browser without a graphics card turns smoothly."""
FARTHEST = 4.0
"""Times the median distance; what lies behind would make everything else small."""
FEW = 0.01
"""Share of the points on either side, along each axis, that may lie apart from the others."""
APART = 0.25
"""Lengths of the others beyond which they do; the viewer would look at the middle between them and the others."""


def write_model(path: Path, points: NDArray[np.floating[Any]], colors: NDArray[np.uint8]) -> None:
    """Write points as GLB, in glTF's axes: x right, y up, z towards the viewer.

    Args:
        path: The file, `.glb`.
        points: (N, 3), at least one; x right, y down, z ahead.
        colors: (N, 3) uint8 sRGB.
    """
    near = points[:, 2] <= FARTHEST * np.median(points[:, 2])
    first, last = np.quantile(points[near], (FEW, 1 - FEW), axis=0)
    margin = APART * (last - first)
    shown = near & ((points >= first - margin) & (points <= last + margin)).all(axis=1)
    points, colors = points[shown], colors[shown]
    step = -(-len(points) // MOST_POINTS)
    cloud = trimesh.PointCloud((points[::step] * (1, -1, -1)).astype(np.float32), colors=colors[::step])
    write_bytes(path, trimesh.Scene(cloud).export(file_type="glb"))

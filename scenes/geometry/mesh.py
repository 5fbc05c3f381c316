"""Triangle meshes as numpy arrays, as shapes build them and Blender receives them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh with texture coordinates at the corners of its triangles."""

    vertices: NDArray[np.float64]
    """(V, 3), local coordinates."""
    triangles: NDArray[np.int32]
    """(F, 3) indices into `vertices`, counter-clockwise seen from outside."""
    corner_uv: NDArray[np.float32]
    """(F, 3, 2) texture coordinates of each triangle's corners, in local units (in metres for metric
    shapes)."""
    smooth: bool = False
    """Whether shading normals are interpolated over the surface (geometry is unaffected)."""
    slots: NDArray[np.int32] | None = None
    """(F,) which of its object's materials each triangle has (`SceneObject.materials`); None for the first."""

"""An independent float64 ray cast: every triangle against every pixel centre it can cover, nearest wins."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def cast_depth(
    triangles: NDArray[np.float64], width: int, height: int, focal_px: float, shift_px: float = 0.0
) -> NDArray[np.float64]:
    """(H, W) depth along -z of the first surface through (column + 0.5 + shift, row + 0.5), inf for none.

    triangles: (T, 3, 3) in the camera's frame (x right, y up, looking along -z).
    """
    depth = np.full((height, width), np.inf)
    for k in range(triangles.shape[0]):
        a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        normal = np.cross(b - a, c - a)
        offset = normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2]
        first_row, last_row, first_column, last_column = 0, height - 1, 0, width - 1
        if a[2] < -1e-6 and b[2] < -1e-6 and c[2] < -1e-6:
            u = np.array([-a[0] / a[2], -b[0] / b[2], -c[0] / c[2]]) * focal_px + width / 2
            v = np.array([a[1] / a[2], b[1] / b[2], c[1] / c[2]]) * focal_px + height / 2
            first_column = max(0, int(np.floor(u.min())) - 1)
            last_column = min(width - 1, int(np.ceil(u.max())) + 1)
            first_row = max(0, int(np.floor(v.min())) - 1)
            last_row = min(height - 1, int(np.ceil(v.max())) + 1)
        for i in range(first_row, last_row + 1):
            y = -(i + 0.5 - height / 2) / focal_px
            for j in range(first_column, last_column + 1):
                x = (j + 0.5 + shift_px - width / 2) / focal_px
                slope = normal[0] * x + normal[1] * y - normal[2]
                if slope == 0.0:
                    continue
                z = offset / slope
                if z <= 0.0 or z >= depth[i, j]:
                    continue
                point = np.array([x * z, y * z, -z])
                if (
                    _inside(normal, a, b, point)
                    and _inside(normal, b, c, point)
                    and _inside(normal, c, a, point)
                ):
                    depth[i, j] = z
    return depth


@njit(cache=True)
def _inside(
    normal: NDArray[np.float64],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    point: NDArray[np.float64],
) -> bool:
    side = np.cross(end - start, point - start)
    return normal[0] * side[0] + normal[1] * side[1] + normal[2] * side[2] >= 0.0

"""An independent float64 ray cast: every triangle against every pixel centre it can cover, nearest wins."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

NEAR_M = 1e-6


def to_camera_frame(
    triangles: NDArray[np.float64], camera_to_world: NDArray[np.float64]
) -> NDArray[np.float64]:
    """World-space corners (T, 3, 3) in the frame of a camera with the given (4, 4) pose (a rigid motion)."""
    return (triangles - camera_to_world[:3, 3]) @ camera_to_world[:3, :3]


@njit(cache=True)
def cast_depth(
    triangles: NDArray[np.float64], width: int, height: int, fx: float, fy: float, cx: float, cy: float
) -> NDArray[np.float64]:
    """(H, W) depth along -z of the first surface through (column + 0.5, row + 0.5), inf for none.

    triangles: (T, 3, 3) in the camera's frame (x right, y up, looking along -z).
    fx, fy, cx, cy: Focal lengths and principal point in px.
    """
    depth = np.full((height, width), np.inf)
    for k in range(triangles.shape[0]):
        t = triangles[k]
        if t[0, 2] >= -NEAR_M and t[1, 2] >= -NEAR_M and t[2, 2] >= -NEAR_M:
            continue
        rows, columns = _window(t, width, height, fx, fy, cx, cy)
        e1x, e1y, e1z = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
        e2x, e2y, e2z = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
        nx, ny, nz = e1y * e2z - e1z * e2y, e1z * e2x - e1x * e2z, e1x * e2y - e1y * e2x
        offset = nx * t[0, 0] + ny * t[0, 1] + nz * t[0, 2]
        for i in range(rows[0], rows[1] + 1):
            y = -(i + 0.5 - cy) / fy
            for j in range(columns[0], columns[1] + 1):
                x = (j + 0.5 - cx) / fx
                slope = nx * x + ny * y - nz
                if slope == 0.0:
                    continue
                z = offset / slope
                if 0.0 < z < depth[i, j] and _inside(t, nx, ny, nz, x * z, y * z, -z):
                    depth[i, j] = z
    return depth


@njit(cache=True)
def _window(
    t: NDArray[np.float64], width: int, height: int, fx: float, fy: float, cx: float, cy: float
) -> tuple[tuple[int, int], tuple[int, int]]:
    """First and last row and column that a triangle can cover: all of them if it crosses the view's plane."""
    if t[0, 2] > -NEAR_M or t[1, 2] > -NEAR_M or t[2, 2] > -NEAR_M:
        return (0, height - 1), (0, width - 1)
    low_u, high_u, low_v, high_v = math.inf, -math.inf, math.inf, -math.inf
    for k in range(3):
        u, v = -t[k, 0] / t[k, 2] * fx + cx, t[k, 1] / t[k, 2] * fy + cy
        low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, v), max(high_v, v)
    first_row, last_row = max(0.0, low_v - 2), min(height - 1.0, high_v + 2)
    first_column, last_column = max(0.0, low_u - 2), min(width - 1.0, high_u + 2)
    if first_row > last_row or first_column > last_column:
        return (0, -1), (0, -1)
    return (int(first_row), int(last_row)), (int(first_column), int(last_column))


@njit(cache=True)
def _inside(t: NDArray[np.float64], nx: float, ny: float, nz: float, px: float, py: float, pz: float) -> bool:
    """Whether a point of the triangle's plane is on the inner side of all three edges."""
    for k in range(3):
        m = (k + 1) % 3
        ex, ey, ez = t[m, 0] - t[k, 0], t[m, 1] - t[k, 1], t[m, 2] - t[k, 2]
        qx, qy, qz = px - t[k, 0], py - t[k, 1], pz - t[k, 2]
        side = nx * (ey * qz - ez * qy) + ny * (ez * qx - ex * qz) + nz * (ex * qy - ey * qx)
        if side < 0.0:
            return False
    return True


@njit(cache=True)
def segment_is_blocked(
    triangles: NDArray[np.float64], start: NDArray[np.float64], way: NDArray[np.float64], reach: float
) -> bool:
    """Whether any triangle (T, 3, 3) meets start + s way with 0 < s < reach (Moeller and Trumbore 1997)."""
    wx, wy, wz = way[0], way[1], way[2]
    for k in range(triangles.shape[0]):
        t = triangles[k]
        ax, ay, az = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
        bx, by, bz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
        tx, ty, tz = start[0] - t[0, 0], start[1] - t[0, 1], start[2] - t[0, 2]
        px, py, pz = wy * bz - wz * by, wz * bx - wx * bz, wx * by - wy * bx
        determinant = ax * px + ay * py + az * pz
        if determinant == 0.0:
            continue
        u = (tx * px + ty * py + tz * pz) / determinant
        if u < 0.0 or u > 1.0:
            continue
        qx, qy, qz = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax
        v = (wx * qx + wy * qy + wz * qz) / determinant
        if v >= 0.0 and u + v <= 1.0 and 0.0 < (bx * qx + by * qy + bz * qz) / determinant < reach:
            return True
    return False

"""Building blocks of meshes: grids, tubes, welding, creases, texture coordinates.

All functions take (V, 3) float64 vertices and (F, 3) triangles.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import trimesh
from manifold3d import CrossSection, FillRule, Manifold
from numpy.typing import NDArray

from scenes.geometry import kernels as mesh_kernels
from scenes.geometry.mesh import Mesh

Vertices = NDArray[np.float64]
Triangles = NDArray[np.int64]
Part = tuple[Vertices, Triangles]
"""A surface: its vertices (V, 3) and its triangles (F, 3)."""

_MIN_DOUBLE_AREA = 1e-12
"""Triangles of less than half this area (local units squared) are dropped: they have no direction."""


def solid(
    vertices: Vertices,
    triangles: Triangles,
    *,
    uv: NDArray[np.float64] | None = None,
    smooth: bool = False,
    crease_deg: float | None = 40.0,
) -> Mesh:
    """A Mesh from a closed surface: fitted to the unit cube, oriented outward, welded, textured.

    `uv` (F, 3, 2) are texture coordinates in the unit of `vertices`; without them the surface is box mapped.
    With `smooth`, edges sharper than `crease_deg` stay sharp: their vertices are split. None says that there
    are no such edges.
    """
    mesh, corners = traced_solid(
        vertices, triangles, smooth=smooth, crease_deg=crease_deg, box_mapped=uv is None
    )
    if uv is None:
        return mesh
    _, factor = fit_to_cube(vertices)
    return replace(mesh, corner_uv=np.ascontiguousarray(uv.reshape(-1, 2)[corners] * factor, np.float32))


def traced_solid(
    vertices: Vertices,
    triangles: Triangles,
    *,
    smooth: bool = False,
    crease_deg: float | None = 40.0,
    box_mapped: bool = True,
) -> tuple[Mesh, NDArray[np.intp]]:
    """A Mesh as `solid` makes it, and where the corners of its triangles come from.

    These are, (F, 3), the places of its corners among those of the given triangles, of which triangle k has 3 k to
    3 k + 2. Without `box_mapped` the mesh has no texture coordinates.
    """
    vertices, _ = fit_to_cube(vertices)
    vertices, triangles, kept, normals = _merged(vertices, triangles)
    corners = 3 * np.asarray(kept)[:, None] + np.arange(3)
    # The divergence theorem: positive when the triangles run counter-clockwise seen from outside.
    if np.einsum("ij,ij->", vertices[triangles[:, 0]], normals) < 0:
        triangles, corners, normals = triangles[:, ::-1], corners[:, ::-1], -normals
    uv = (
        mesh_kernels.dominant_plane_uv(vertices, triangles, normals)
        if box_mapped
        else np.zeros((len(triangles), 3, 2))
    )
    if smooth and crease_deg is not None:
        vertices, triangles = split_creases(vertices, triangles, normals, crease_deg)
    mesh = Mesh(
        np.ascontiguousarray(vertices),
        np.ascontiguousarray(triangles, np.int32),
        np.ascontiguousarray(uv, np.float32),
        smooth,
    )
    return mesh, corners


def fit_to_cube(vertices: Vertices) -> tuple[Vertices, float]:
    """Centre the bounding box and scale its longest axis to [-1, 1]; also returns the scale factor."""
    low, high = mesh_kernels.bounds(vertices)
    factor = 2.0 / float((high - low).max())
    return (vertices - (low + high) / 2) * factor, factor


def weld(vertices: Vertices, triangles: Triangles) -> tuple[Vertices, Triangles, NDArray[np.intp]]:
    """Merge coinciding vertices and drop the triangles that collapse.

    Returns the vertices in use, the remaining triangles and their indices among the given ones.
    """
    vertices, triangles, kept, _ = _merged(vertices, triangles)
    return vertices, triangles, kept


def _merged(
    vertices: Vertices, triangles: Triangles
) -> tuple[Vertices, Triangles, NDArray[np.intp], Vertices]:
    """The result of `weld`, and the scaled normals of the remaining triangles."""
    low, high = mesh_kernels.bounds(vertices)
    # The odd factor keeps 0, 1/2 and the like off the rounding boundaries.
    keys = mesh_kernels.cell_keys(vertices, low, 2097000.123 / float((high - low).max()))
    order = np.argsort(keys, kind="stable")
    merged: tuple[Vertices, Triangles, NDArray[np.intp], Vertices] = mesh_kernels.merged(
        vertices, triangles, keys, order, _MIN_DOUBLE_AREA
    )
    return merged


def scaled_normals(vertices: Vertices, triangles: Triangles) -> Vertices:
    """(F, 3) triangle normals, their lengths twice the areas."""
    normals: Vertices = mesh_kernels.triangle_normals(vertices, triangles)
    return normals


def box_uv(vertices: Vertices, triangles: Triangles) -> NDArray[np.float64]:
    """(F, 3, 2) texture coordinates: each triangle projected along its normal's dominant axis."""
    uv: NDArray[np.float64] = mesh_kernels.dominant_plane_uv(
        vertices, triangles, scaled_normals(vertices, triangles)
    )
    return uv


def split_creases(
    vertices: Vertices, triangles: Triangles, normals: Vertices, angle_deg: float
) -> tuple[Vertices, Triangles]:
    """Give each side of every sharp edge its own vertices, so that interpolated normals stop there.

    Corners of triangles are joined across edges whose dihedral angle is below `angle_deg`; each connected
    group of corners becomes one vertex.
    """
    split: tuple[Vertices, Triangles] = mesh_kernels.split_at_creases(
        np.ascontiguousarray(vertices),
        np.ascontiguousarray(triangles, np.int64),
        np.ascontiguousarray(normals),
        np.cos(np.radians(angle_deg)),
    )
    return split


def grid_triangles(
    rows: int, columns: int, *, wrap_rows: bool = False, wrap_columns: bool = False
) -> Triangles:
    """Two triangles for each cell of a grid of rows x columns vertices, optionally closed on itself."""
    r = np.arange(rows if wrap_rows else rows - 1)[:, None]
    c = np.arange(columns if wrap_columns else columns - 1)[None, :]
    below, right = (r + 1) % rows * columns, (c + 1) % columns
    a, b = r * columns + c, r * columns + right
    d, e = below + c, below + right
    cells = np.stack([np.stack([a, b, e], -1), np.stack([a, e, d], -1)], axis=2)
    return cells.reshape(-1, 3).astype(np.int64)


def grid_rim(rows: int, columns: int) -> NDArray[np.int64]:
    """Indices of the border of a grid of rows x columns vertices, once around in the sense of its triangles."""
    index = np.arange(rows * columns, dtype=np.int64).reshape(rows, columns)
    return np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])


def slab_triangles(rows: int, columns: int) -> Triangles:
    """The closed slab between two grids of rows x columns vertices: first all of the top, then all of the bottom."""
    count = rows * columns
    face, rim = grid_triangles(rows, columns), grid_rim(rows, columns)
    following = np.roll(rim, -1)
    walls = [
        np.stack([rim, rim + count, following + count], -1),
        np.stack([rim, following + count, following], -1),
    ]
    return np.concatenate([face, face[:, ::-1] + count, *walls])


def block_under(
    top: NDArray[np.float64], floor: float, middle: tuple[float, float] | None = None
) -> tuple[Vertices, Triangles]:
    """The closed block between a surface (R, C, 3) and a flat floor at z = `floor`.

    The floor is a fan about `middle` (x, y), by default the mean of the surface's points.
    """
    rows, columns = top.shape[:2]
    ring = grid_rim(rows, columns)
    points = top.reshape(-1, 3)
    skirt = np.column_stack([points[ring, :2], np.full(len(ring), floor)])
    below = len(points) + np.arange(len(ring))
    along, along_below = np.roll(ring, -1), np.roll(below, -1)
    hub = np.full(len(ring), len(points) + len(ring))
    walls = [np.stack([ring, below, along_below], -1), np.stack([ring, along_below, along], -1)]
    triangles = np.concatenate(
        [grid_triangles(rows, columns), *walls, np.stack([hub, along_below, below], -1)]
    )
    centre = points[:, :2].mean(axis=0) if middle is None else middle
    return np.concatenate([points, skirt, [(*centre, floor)]]), triangles


def revolve(
    radius: NDArray[np.float64], height: NDArray[np.float64], sides: int, angle: float = 0.0
) -> tuple[Vertices, Triangles]:
    """The surface of revolution of a profile (radius, height), (N,) each, about the z axis.

    It is closed where the profile starts and ends on the axis; `solid` welds the poles.
    """
    theta = angle + np.linspace(0, 2 * np.pi, sides, endpoint=False)
    x, y = radius[:, None] * np.cos(theta), radius[:, None] * np.sin(theta)
    z = np.broadcast_to(height[:, None], x.shape)
    return np.stack([x, y, z], -1).reshape(-1, 3), grid_triangles(len(radius), sides, wrap_columns=True)


def tube(
    path: Vertices, radius: NDArray[np.float64], sides: int, *, closed: bool = False
) -> tuple[Vertices, Triangles, NDArray[np.float64]]:
    """A round tube along a path (N, 3) of given radii (N,): vertices, triangles, (F, 3, 2) texture coordinates.

    Frames are transported without twist by double reflection (Wang et al., "Computation of rotation
    minimizing frames", 2008). Texture coordinates are arc length along and around, mirrored half way round
    (and along, on a closed path), so that there is no seam.
    """
    frame_u, frame_v = _transported_frames(path, closed)
    theta = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.cos(theta)[:, None] * frame_u[:, None] + np.sin(theta)[:, None] * frame_v[:, None]
    vertices = (path[:, None] + radius[:, None, None] * ring).reshape(-1, 3)
    count = len(path)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if closed:
        along = np.abs(along - (along[-1] + float(np.linalg.norm(path[0] - path[-1]))) / 2)
    around = np.abs(np.pi - theta) * float(radius.mean())
    uv = np.stack(np.broadcast_arrays(along[:, None], around[None, :]), -1).reshape(-1, 2)
    triangles = grid_triangles(count, sides, wrap_rows=closed, wrap_columns=True)
    if not closed:
        rim = np.arange(sides)
        following = np.roll(rim, -1)
        last = (count - 1) * sides
        centres = count * sides + np.arange(2)[:, None].repeat(sides, 1)
        first_cap = np.stack([centres[0], following, rim], -1)
        last_cap = np.stack([centres[1], last + rim, last + following], -1)
        triangles = np.concatenate([triangles, first_cap, last_cap])
        vertices = np.concatenate([vertices, path[[0, -1]]])
        uv = np.concatenate([uv, [(0.0, 0.0), (float(along[-1]), 0.0)]])
    return vertices, triangles, uv[triangles]


def _transported_frames(path: Vertices, closed: bool) -> tuple[Vertices, Vertices]:
    """Two unit normals for each point of a path, with the least rotation along it."""
    tangent = np.gradient(path, axis=0)
    if closed:
        tangent = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.empty_like(path)
    start = np.cross(tangent[0], np.eye(3)[np.abs(tangent[0]).argmin()])
    normal[0] = start / np.linalg.norm(start)
    for i in range(len(path) - 1):
        step = path[i + 1] - path[i]
        scale = 2.0 / step.dot(step)
        reflected = normal[i] - scale * step.dot(normal[i]) * step
        mirrored = tangent[i] - scale * step.dot(tangent[i]) * step
        across = tangent[i + 1] - mirrored
        length = across.dot(across)
        if length > 1e-20:
            reflected = reflected - 2.0 / length * across.dot(reflected) * across
        normal[i + 1] = reflected
    if closed:
        normal = _close_frames(normal, tangent)
    return normal, np.cross(tangent, normal)


def _close_frames(normal: Vertices, tangent: Vertices) -> Vertices:
    """Spread the angle by which the last frame misses the first evenly along a closed path."""
    last, first = normal[-1], normal[0]
    miss = np.arctan2(np.dot(np.cross(last, first), tangent[0]), np.dot(last, first))
    angle = miss * np.linspace(0, 1, len(normal), endpoint=False)[:, None]
    return np.cos(angle) * normal + np.sin(angle) * np.cross(tangent, normal)


def struts(
    start: Vertices,
    end: Vertices,
    start_radius: NDArray[np.float64],
    end_radius: NDArray[np.float64],
    sides: int,
) -> tuple[Vertices, Triangles]:
    """Closed straight prisms between (M, 3) end points, tapering from one radius (M,) to the other."""
    axis = end - start
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    helper = np.eye(3)[np.abs(axis).argmin(axis=1)]
    side_u = np.cross(axis, helper)
    side_u /= np.linalg.norm(side_u, axis=1, keepdims=True)
    side_v = np.cross(axis, side_u)
    theta = np.linspace(0, 2 * np.pi, sides, endpoint=False) + np.pi / sides
    ring = np.cos(theta)[:, None] * side_u[:, None] + np.sin(theta)[:, None] * side_v[:, None]
    bottom = start[:, None] + start_radius[:, None, None] * ring
    top = end[:, None] + end_radius[:, None, None] * ring
    vertices = np.concatenate([bottom, top], axis=1).reshape(-1, 3)
    i = np.arange(sides)
    j = np.roll(i, -1)
    walls = np.concatenate([np.stack([i, j, j + sides], -1), np.stack([i, j + sides, i + sides], -1)])
    fan = np.stack([np.zeros(sides - 2, np.int64), i[2:], i[1:-1]], -1)
    one = np.concatenate([walls, fan, fan[:, ::-1] + sides])
    triangles = one[None] + (2 * sides * np.arange(len(start)))[:, None, None]
    return vertices, triangles.reshape(-1, 3)


def joined(*parts: tuple[Vertices, Triangles]) -> tuple[Vertices, Triangles]:
    """Several surfaces as one, with the triangles of each in turn."""
    offsets = np.cumsum([0] + [len(vertices) for vertices, _ in parts])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    triangles = np.concatenate([t + offset for (_, t), offset in zip(parts, offsets, strict=False)])
    return vertices, triangles


@lru_cache(maxsize=8)
def icosphere(subdivisions: int) -> tuple[Vertices, Triangles]:
    """The unit sphere as 20 * 4^subdivisions triangles. The arrays are shared: do not change them."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.array(sphere.vertices, np.float64), np.array(sphere.faces, np.int64)


def cross_section(*contours: NDArray[np.float64]) -> CrossSection:
    """A plane region bounded by (N, 2) contours; one inside another cuts a hole."""
    return CrossSection([np.asarray(contour, np.float64) for contour in contours], FillRule.EvenOdd)


def manifold_arrays(body: Manifold) -> tuple[Vertices, Triangles]:
    """Vertices and triangles of a manifold3d solid."""
    mesh = body.to_mesh64()
    return np.array(mesh.vert_properties[:, :3], np.float64), np.array(mesh.tri_verts, np.int64)


def extrude_triangles(
    plan: NDArray[np.float64], triangles: Triangles, height: float
) -> tuple[Vertices, Triangles]:
    """The prism over a triangulated plane region: `plan` (V, 2), counter-clockwise `triangles` (F, 3)."""
    flat = np.column_stack([plan, np.zeros(len(plan))])
    flat, triangles, _ = weld(flat, triangles)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    count = len(flat)
    outline = ~np.isin(start * count + end, end * count + start)
    a, b = start[outline], end[outline]
    walls = np.concatenate([np.stack([a, b, b + count], -1), np.stack([a, b + count, a + count], -1)])
    vertices = np.concatenate([flat, flat + np.array((0.0, 0.0, height))])
    return vertices, np.concatenate([triangles[:, ::-1], triangles + count, walls])


def regular_polygon(corners: int, radius: float = 1.0, angle: float = 0.0) -> NDArray[np.float64]:
    """(corners, 2) points on a circle, counter-clockwise."""
    theta = angle + np.linspace(0, 2 * np.pi, corners, endpoint=False)
    return radius * np.stack([np.cos(theta), np.sin(theta)], -1)

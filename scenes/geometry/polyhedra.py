"""Closed surfaces from corners and rings: boxes, hexahedra, lofts; and the parts they are moved about as."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenes.geometry.building import Part, Triangles, Vertices

_CUBE_CORNERS = np.array([(x, y, z) for z in (0, 1) for y, x in ((0, 0), (0, 1), (1, 1), (1, 0))], np.float64)
_CUBE_TRIANGLES = np.array(
    [
        *((0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)),
        *((0, 1, 5), (0, 5, 4), (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)),
    ],
    np.int64,
)


def boxes(low: NDArray[np.float64], high: NDArray[np.float64]) -> Part:
    """Axis-aligned boxes between opposite corners `low` and `high`, (N, 3) or (3,) each."""
    low, high = np.atleast_2d(low), np.atleast_2d(high)
    corners = low[:, None] + _CUBE_CORNERS * (high - low)[:, None]
    return hexahedra(corners)


def hexahedra(corners: NDArray[np.float64]) -> Part:
    """Bodies with six faces from (N, 8, 3) corners.

    The first four corners run around one face, the last four are those opposite them. Either sense of
    rotation will do.
    """
    local = corners - corners[:, :1]
    a, b, c = (local[:, _CUBE_TRIANGLES[:, k]] for k in range(3))
    inside_out = np.einsum("nfi,nfi->n", a, np.cross(b, c)) < 0
    faces = np.where(inside_out[:, None, None], _CUBE_TRIANGLES[:, ::-1], _CUBE_TRIANGLES)
    triangles = faces + 8 * np.arange(len(corners))[:, None, None]
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)


def loft(rings: NDArray[np.float64]) -> Part:
    """The closed surface through rings (R, N, 3) of corresponding points; fans close its two ends."""
    count, sides = rings.shape[:2]
    index = np.arange(count * sides).reshape(count, sides)
    a, b = index[:-1], np.roll(index, -1, axis=1)[:-1]
    c, d = np.roll(index, -1, axis=1)[1:], index[1:]
    walls = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3)
    middles = np.stack([rings[0].mean(axis=0), rings[-1].mean(axis=0)])
    first, following = index[0], np.roll(index[0], -1)
    last, last_following = index[-1], np.roll(index[-1], -1)
    hubs = count * sides + np.zeros(sides, np.int64)
    caps = np.concatenate(
        [np.stack([hubs, following, first], -1), np.stack([hubs + 1, last, last_following], -1)]
    )
    vertices, triangles = np.concatenate([rings.reshape(-1, 3), middles]), np.concatenate([walls, caps])
    return vertices, outward(vertices, triangles)


def outward(vertices: Vertices, triangles: Triangles) -> Triangles:
    """The triangles (F, 3) of one closed body, oriented counter-clockwise seen from outside."""
    a, b, c = (vertices[triangles[:, k]] - vertices[0] for k in range(3))
    return triangles if np.einsum("ij,ij->", a, np.cross(b, c)) > 0 else triangles[:, ::-1]


def turned(part: Part, yaw_deg: float, offset: tuple[float, float, float]) -> Part:
    """A part turned about the z axis by an angle, then moved by an offset."""
    rotation = Rotation.from_euler("Z", yaw_deg, degrees=True)
    return rotation.apply(part[0]) + np.array(offset), part[1]

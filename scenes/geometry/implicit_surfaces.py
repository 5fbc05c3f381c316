"""Implicit surfaces of soft bodies: blended capsules, meshed by surface nets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.geometry import kernels
from scenes.geometry.building import Triangles, Vertices
from stereoforge_kit.errors import InputError


def capsule_distances(
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    start_radius: NDArray[np.float64],
    end_radius: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(N, B) signed distances of points (N, 3) to tapered capsules between (B, 3) ends.

    The radius is interpolated at the foot of the perpendicular, which is exact for equal radii.
    """
    axis = end - start
    squared = np.maximum(np.einsum("ij,ij->i", axis, axis), 1e-12)
    share = np.clip((points @ axis.T - np.einsum("ij,ij->i", start, axis)) / squared, 0.0, 1.0)
    from_start = (points**2).sum(axis=1)[:, None] - 2 * points @ start.T + np.einsum("ij,ij->i", start, start)
    # |p - (a + t d)|^2 = |p - a|^2 - 2 t (p - a).d + t^2 d.d
    reach = points @ axis.T - np.einsum("ij,ij->i", start, axis)
    distance = np.sqrt(np.maximum(from_start - 2 * share * reach + share**2 * squared, 0.0))
    signed: NDArray[np.float64] = distance - (start_radius + (end_radius - start_radius) * share)
    return signed


def blended_capsules(
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    start_radius: NDArray[np.float64],
    end_radius: NDArray[np.float64],
    blend: float,
) -> NDArray[np.float64]:
    """(N,) smooth minimum of the distances of points (N, 3) to capsules: they blend where closer than about `blend`.

    It is -blend * log(sum(exp(-distance / blend))). The other arguments are those of `capsule_distances`.
    """
    field: NDArray[np.float64] = kernels.blended_capsules(points, start, end, start_radius, end_radius, blend)
    return field


def surface_net(field: NDArray[np.float64]) -> tuple[Vertices, Triangles]:
    """The closed surface where a (X, Y, Z) field is zero, in grid units; negative is inside.

    One vertex in each cell the surface passes, at the mean of its crossings with the cell's edges, and one
    quadrilateral for each crossed edge of the grid (S. Gibson, "Constrained elastic surface nets", 1998).
    The border of the field must be positive. Raises ValueError for a field without an inside.
    """
    inside = field < 0
    if not inside.any():
        raise InputError("the field is nowhere negative: there is no surface")
    cells = np.array(field.shape) - 1
    total = np.zeros((*cells, 3))
    crossings = np.zeros(cells, np.int32)
    for axis in range(3):
        _add_crossings(field, inside, axis, total, crossings)
    used = crossings > 0
    label = np.full(cells, -1, np.int64)
    label[used] = np.arange(np.count_nonzero(used))
    vertices = total[used] / crossings[used][:, None]
    quads = np.concatenate([_crossed_quads(inside, label, axis) for axis in range(3)])
    # Each quadrilateral is split along its shorter diagonal.
    first = np.linalg.norm(vertices[quads[:, 0]] - vertices[quads[:, 2]], axis=1)
    second = np.linalg.norm(vertices[quads[:, 1]] - vertices[quads[:, 3]], axis=1)
    quads = np.where((first <= second)[:, None], quads, np.roll(quads, 1, axis=1))
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _add_crossings(
    field: NDArray[np.float64],
    inside: NDArray[np.bool_],
    axis: int,
    total: NDArray[np.float64],
    crossings: NDArray[np.int32],
) -> None:
    """Add the zero crossings of the grid edges along an axis to the four cells around each of them."""
    low = [slice(None)] * 3
    high = [slice(None)] * 3
    low[axis], high[axis] = slice(None, -1), slice(1, None)
    where = np.argwhere(inside[tuple(low)] != inside[tuple(high)])
    below = field[tuple(low)][tuple(where.T)]
    above = field[tuple(high)][tuple(where.T)]
    point = where.astype(np.float64)
    # Away from the grid's own points, where the vertices of neighbouring cells would coincide.
    point[:, axis] += np.clip(below / (below - above), 0.05, 0.95)
    one, two = (k for k in range(3) if k != axis)
    for step_one in (0, 1):
        for step_two in (0, 1):
            cell = where.copy()
            cell[:, one] -= step_one
            cell[:, two] -= step_two
            np.add.at(total, tuple(cell.T), point)
            np.add.at(crossings, tuple(cell.T), 1)


def _crossed_quads(inside: NDArray[np.bool_], label: NDArray[np.int64], axis: int) -> NDArray[np.int64]:
    """(Q, 4) the cells around each crossed edge along an axis, counter-clockwise seen from outside."""
    low = [slice(None)] * 3
    high = [slice(None)] * 3
    low[axis], high[axis] = slice(None, -1), slice(1, None)
    leaving = inside[tuple(low)] & ~inside[tuple(high)]
    entering = ~inside[tuple(low)] & inside[tuple(high)]
    one, two = (axis + 1) % 3, (axis + 2) % 3
    quads = []
    for crossed, turn in ((leaving, 1), (entering, -1)):
        where = np.argwhere(crossed)
        corners = []
        for step_one, step_two in ((1, 1), (0, 1), (0, 0), (1, 0))[::turn]:
            cell = where.copy()
            cell[:, one] -= step_one
            cell[:, two] -= step_two
            corners.append(label[tuple(cell.T)])
        quads.append(np.stack(corners, -1))
    return np.concatenate(quads)

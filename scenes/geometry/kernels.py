"""The loops over triangles that every mesh goes through, compiled: numpy needs a dozen passes for each of them.

Each does the arithmetic of the numpy expression it stands for, in the same order, so the same bytes come out.
"""

from __future__ import annotations

import numpy as np

from stereoforge_kit.kernels import njit


@njit()
def bounds(vertices):
    """(3,) least and (3,) greatest coordinates of vertices (V, 3)."""
    low, high = vertices[0].copy(), vertices[0].copy()
    for vertex in range(1, len(vertices)):
        for axis in range(3):
            low[axis] = min(low[axis], vertices[vertex, axis])
            high[axis] = max(high[axis], vertices[vertex, axis])
    return low, high


@njit()
def cell_keys(vertices, low, steps_per_unit):
    """(V,) one integer a vertex, 21 bits an axis: the cell of a fine grid that it lies in."""
    keys = np.empty(len(vertices), np.int64)
    for vertex in range(len(vertices)):
        key = 0
        for axis in range(3):
            key = (key << 21) | np.int64(np.rint((vertices[vertex, axis] - low[axis]) * steps_per_unit))
        keys[vertex] = key
    return keys


@njit()
def triangle_normals(vertices, triangles):
    """(F, 3) normals of triangles (F, 3), their length twice the area."""
    normals = np.empty((len(triangles), 3))
    for face in range(len(triangles)):
        a, b, c = triangles[face]
        x1, y1, z1 = vertices[b] - vertices[a]
        x2, y2, z2 = vertices[c] - vertices[a]
        normals[face, 0] = y1 * z2 - z1 * y2
        normals[face, 1] = z1 * x2 - x1 * z2
        normals[face, 2] = x1 * y2 - y1 * x2
    return normals


@njit()
def merged(vertices, triangles, keys, order, least_double_area):
    """Vertices of equal keys merged, triangles of less than a least double area dropped, unused vertices too.

    `order` sorts the keys (V,), stably. Returns vertices, triangles, the rows of the triangles kept, and the kept
    triangles' scaled normals.
    """
    label = np.empty(len(vertices), np.int64)
    distinct = np.empty((len(vertices), 3))
    count = -1
    for place in range(len(order)):
        vertex = order[place]
        if place == 0 or keys[vertex] != keys[order[place - 1]]:
            count += 1
            distinct[count] = vertices[vertex]
        label[vertex] = count
    merged_triangles = np.empty((len(triangles), 3), np.int64)
    for face in range(len(triangles)):
        for corner in range(3):
            merged_triangles[face, corner] = label[triangles[face, corner]]
    normals = triangle_normals(distinct, merged_triangles)
    kept = np.empty(len(triangles), np.intp)
    used = np.zeros(count + 1, np.bool_)
    faces = 0
    for face in range(len(triangles)):
        x, y, z = normals[face]
        if x * x + y * y + z * z > least_double_area**2:
            kept[faces] = face
            faces += 1
            for corner in range(3):
                used[merged_triangles[face, corner]] = True
    kept = kept[:faces]
    rank = np.cumsum(used) - 1
    clean = np.empty((faces, 3), np.int64)
    for face in range(faces):
        for corner in range(3):
            clean[face, corner] = rank[merged_triangles[kept[face], corner]]
    return distinct[: count + 1][used], clean, kept, normals[kept]


@njit()
def dominant_plane_uv(vertices, triangles, normals):
    """(F, 3, 2) coordinates of triangles projected along the dominant axis of their normals."""
    uv = np.empty((len(triangles), 3, 2))
    for face in range(len(triangles)):
        x, y, z = np.abs(normals[face])
        u, v = 0, 1
        if x >= y and x >= z:
            u, v = 1, 2
        elif y >= z:
            u, v = 0, 2
        for corner in range(3):
            uv[face, corner, 0] = vertices[triangles[face, corner], u]
            uv[face, corner, 1] = vertices[triangles[face, corner], v]
    return uv


@njit()
def shared_edges(triangles, vertex_count):
    """Pairs of half-edges (P,), (P,) along the same edge; half-edge 3 f + k leaves corner k of triangle f.

    Of more than two along one edge each is paired with the next.
    """
    corners = triangles.ravel()
    count = len(corners)
    lower, upper = np.empty(count, np.int64), np.empty(count, np.int64)
    first = np.zeros(vertex_count + 1, np.int64)
    for half in range(count):
        start, end = corners[half], corners[half - half % 3 + (half + 1) % 3]
        lower[half], upper[half] = min(start, end), max(start, end)
        first[lower[half] + 1] += 1
    first = np.cumsum(first)
    by_lower = np.empty(count, np.int64)
    place = first[:-1].copy()
    for half in range(count):
        by_lower[place[lower[half]]] = half
        place[lower[half]] += 1
    one, two = np.empty(count, np.int64), np.empty(count, np.int64)
    pairs = 0
    latest, latest_of = np.empty(vertex_count, np.int64), np.full(vertex_count, -1, np.int64)
    for vertex in range(vertex_count):
        for index in range(first[vertex], first[vertex + 1]):
            half = by_lower[index]
            other = upper[half]
            if latest_of[other] == vertex:
                one[pairs], two[pairs] = latest[other], half
                pairs += 1
            latest_of[other], latest[other] = vertex, half
    return one[:pairs], two[:pairs]


@njit()
def corner_groups(corner_count, one, two):
    """How many groups the corners fall into that are joined across pairs of half-edges, and each corner's group.

    Half-edges of a pair run in opposite directions: the start of one is the end of the other. Groups are counted
    from 0 in the order of their first corners.
    """
    parent = np.arange(corner_count)
    for pair in range(len(one)):
        a, b = one[pair], two[pair]
        for side in range(2):
            p, q = (a, b - b % 3 + (b + 1) % 3) if side == 0 else (a - a % 3 + (a + 1) % 3, b)
            while parent[p] != p:
                parent[p] = parent[parent[p]]
                p = parent[p]
            while parent[q] != q:
                parent[q] = parent[parent[q]]
                q = parent[q]
            if p < q:
                parent[q] = p
            else:
                parent[p] = q
    label = np.empty(corner_count, np.int64)
    groups = 0
    for corner in range(corner_count):  # The root of a group is its first corner.
        root = corner
        while parent[root] != root:
            root = parent[root]
        if root == corner:
            label[corner] = groups
            groups += 1
        else:
            label[corner] = label[root]
    return groups, label


@njit()
def split_at_creases(vertices, triangles, normals, least_cosine):
    """Vertices and triangles where the corners of triangles share a vertex only across soft edges.

    An edge is soft if the cosine between the normals beside it is above `least_cosine`.
    """
    unit = np.empty_like(normals)
    for face in range(len(normals)):
        x, y, z = normals[face]
        unit[face] = normals[face] / np.sqrt((x * x + y * y) + z * z)
    one, two = shared_edges(triangles, len(vertices))
    soft = 0
    for pair in range(len(one)):
        a, b = unit[one[pair] // 3], unit[two[pair] // 3]
        # Regular prisms have dihedral angles of exactly the limit: the order of the sum decides there.
        if (a[0] * b[0] + a[2] * b[2]) + a[1] * b[1] > least_cosine:
            one[soft], two[soft] = one[pair], two[pair]
            soft += 1
    groups, label = corner_groups(3 * len(triangles), one[:soft], two[:soft])
    split = np.empty((groups, 3))
    for corner in range(len(label)):
        split[label[corner]] = vertices[triangles[corner // 3, corner % 3]]
    return split, label.reshape(-1, 3)


@njit(fastmath=True, error_model="numpy")
def blended_capsules(points, start, end, start_radius, end_radius, blend):
    """(N,) smooth minimum -blend * log(sum(exp(-distance / blend))) of the distances of points (N, 3) to capsules.

    The capsules, tapered, run between (B, 3) ends of (B,) radii. Those farther than 20 `blend` beyond the nearest add
    nothing that a double holds.
    """
    count = len(start)
    field = np.empty(len(points))
    distance = np.empty(count)
    axis = end - start
    squared = np.empty(count)
    for limb in range(count):
        squared[limb] = max(axis[limb, 0] ** 2 + axis[limb, 1] ** 2 + axis[limb, 2] ** 2, 1e-12)
    for point in range(len(points)):
        nearest = np.inf
        for limb in range(count):
            x = points[point, 0] - start[limb, 0]
            y = points[point, 1] - start[limb, 1]
            z = points[point, 2] - start[limb, 2]
            along = (x * axis[limb, 0] + y * axis[limb, 1] + z * axis[limb, 2]) / squared[limb]
            along = min(max(along, 0.0), 1.0)
            x -= along * axis[limb, 0]
            y -= along * axis[limb, 1]
            z -= along * axis[limb, 2]
            radius = start_radius[limb] + (end_radius[limb] - start_radius[limb]) * along
            distance[limb] = np.sqrt(x * x + y * y + z * z) - radius
            nearest = min(nearest, distance[limb])
        total = 0.0
        for limb in range(count):
            beyond = (nearest - distance[limb]) / blend
            if beyond > -20.0:
                total += np.exp(beyond)
        field[point] = nearest - blend * np.log(total)
    return field

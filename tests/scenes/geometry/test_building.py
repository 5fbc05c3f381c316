"""The mesh-building blocks against closed forms and trimesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import lil_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from scenes.geometry.building import (
    box_uv,
    extrude_triangles,
    fit_to_cube,
    scaled_normals,
    solid,
    split_creases,
    struts,
    tube,
    weld,
)


def test_weld_merges_what_coincides_and_drops_what_collapses() -> None:
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1e-13), (1, 1, 0), (9, 9, 9)], np.float64)
    triangles = np.array([(0, 1, 2), (3, 1, 0), (1, 4, 2)])
    welded, kept_triangles, kept = weld(vertices, triangles)
    assert len(welded) == 4
    assert kept.tolist() == [0, 2]
    np.testing.assert_allclose(welded[kept_triangles], vertices[triangles[kept]], atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_struts_have_the_volume_of_frusta(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, end = rng.normal(size=(2, 1, 3))
    bottom, top = rng.uniform(0.1, 1.0, (2, 1))
    sides = int(rng.integers(3, 9))
    mesh = trimesh.Trimesh(*struts(start, end, bottom, top, sides), process=False)
    assert mesh.is_watertight
    length = float(np.linalg.norm(end - start))
    base = sides / 2 * np.sin(2 * np.pi / sides)
    expected = base * length * float(bottom[0] ** 2 + bottom[0] * top[0] + top[0] ** 2) / 3
    assert mesh.volume == pytest.approx(expected)


def test_a_closed_tube_has_no_seam_in_frames_or_texture() -> None:
    t = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    path = np.stack([np.cos(t), np.sin(t), 0.4 * np.sin(3 * t)], -1)
    vertices, triangles, uv = tube(path, np.full(200, 0.1), 12, closed=True)
    assert trimesh.Trimesh(vertices, triangles, process=False).is_watertight
    # Were a frame turned against the next, some edges would cut across the tube.
    corners = vertices[triangles]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() < 0.12
    # The same vertex has the same texture coordinates in every triangle around it.
    first = np.empty((len(vertices), 2))
    first[triangles.ravel()] = uv.reshape(-1, 2)
    np.testing.assert_array_equal(first[triangles], uv)


def test_box_mapping_takes_the_two_other_axes() -> None:
    vertices = np.array([(1, 0, 0), (1, 2, 0), (1, 0, 3)], np.float64)
    np.testing.assert_array_equal(box_uv(vertices, np.array([(0, 1, 2)]))[0], [(0, 0), (2, 0), (0, 3)])


def test_creases_split_a_cube_into_faces_but_not_a_sphere() -> None:
    box, ball = trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=2)
    for mesh, expected in ((box, 24), (ball, len(ball.vertices))):
        normals = scaled_normals(mesh.vertices, mesh.faces)
        split, triangles = split_creases(np.array(mesh.vertices), np.array(mesh.faces), normals, 40.0)
        assert len(split) == expected
        np.testing.assert_array_equal(split[triangles], mesh.vertices[mesh.faces])


def test_solid_turns_inside_out_surfaces() -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    mesh = solid(np.array(ball.vertices) + 5.0, np.array(ball.faces[:, ::-1]))
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles).volume > 0


def test_fit_to_cube_keeps_proportions() -> None:
    points = (
        Rotation.random(random_state=1).apply(np.random.default_rng(0).normal(size=(50, 3))) * (1, 4, 2) + 7
    )
    fitted, factor = fit_to_cube(points)
    np.testing.assert_allclose(np.ptp(fitted, axis=0), np.ptp(points, axis=0) * factor)
    assert np.ptp(fitted, axis=0).max() == pytest.approx(2.0)


def test_extruding_a_triangulated_square() -> None:
    plan = np.array([(0, 0), (2, 0), (2, 1), (0, 1)], np.float64)
    mesh = trimesh.Trimesh(*extrude_triangles(plan, np.array([(0, 1, 2), (0, 2, 3)]), 0.5), process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(1.0)


def test_creases_of_a_random_solid_against_a_graph_of_its_corners() -> None:
    """Groups of corners by scipy's connected components over the edges that a dictionary finds."""
    mesh = trimesh.creation.icosphere(subdivisions=2)
    vertices = np.array(mesh.vertices) * np.random.default_rng(5).uniform(0.6, 1.0, (len(mesh.vertices), 1))
    triangles = np.array(mesh.faces, np.int64)
    normals = np.cross(*(vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2)))
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    faces_at: dict[tuple[int, ...], list[int]] = {}
    for face, corners in enumerate(triangles):
        for k in range(3):
            faces_at.setdefault(tuple(sorted((corners[k], corners[(k + 1) % 3]))), []).append(face)
    joined = lil_array((triangles.size, triangles.size))
    for ends, (one, two) in faces_at.items():
        if unit[one] @ unit[two] > np.cos(np.radians(40)):
            for end in ends:
                corner, other = (
                    3 * face + int(np.flatnonzero(triangles[face] == end)[0]) for face in (one, two)
                )
                joined[corner, other] = 1
    count, groups = connected_components(joined, directed=False)
    split, split_triangles = split_creases(vertices, triangles, normals, 40.0)
    assert len(vertices) < count < triangles.size  # Some edges are sharp, some are not.
    assert len(split) == count
    # scipy too counts groups by their first members.
    np.testing.assert_array_equal(split_triangles.ravel(), groups)
    np.testing.assert_array_equal(split[split_triangles], vertices[triangles])

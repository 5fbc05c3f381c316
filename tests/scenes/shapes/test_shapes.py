"""Every shape generator: closed, oriented, centred, deterministic meshes. trimesh is the oracle."""

from __future__ import annotations

import dataclasses
import json
from collections import Counter

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.geometry.mesh import Mesh
from scenes.serialization import from_plain, to_plain
from scenes.shapes import SHAPES
from scenes.shapes.anchored import MetricShape
from scenes.shapes.nature.masonry import BlockWall
from scenes.shapes.solids.basic import Box, Ellipsoid
from scenes.shapes.solids.extruded import HoledPlate
from scenes.shapes.solids.organic import Terrain
from scenes.shapes.solids.revolved import Cylinder, Torus
from scenes.shapes.solids.wires import Lattice
from scenes.spec import Shape

SOLIDS = sorted(name for name in SHAPES if name != "Plane")
seeds = st.integers(0, 2**32 - 1)


def drawn(name: str, seed: int) -> Shape:
    return SHAPES[name].sample(np.random.default_rng(seed))


def as_trimesh(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.triangles, process=True)


def open_edges(surface: trimesh.Trimesh) -> int:
    """Directed edges that are not matched by as many in the opposite direction."""
    count = Counter(map(tuple, surface.edges.tolist()))
    return sum(1 for (a, b), n in count.items() if count[(b, a)] != n)


def test_there_are_many_kinds() -> None:
    assert len(SOLIDS) >= 25
    assert all(dataclasses.fields(SHAPES[name]) for name in SOLIDS)


@pytest.mark.parametrize("name", SOLIDS)
@settings(max_examples=12, deadline=None)
@given(seed=seeds)
def test_a_shape_is_a_closed_oriented_surface_that_fills_its_cube(name: str, seed: int) -> None:
    mesh = drawn(name, seed).mesh()
    assert mesh.vertices.dtype == np.float64
    assert mesh.triangles.dtype == np.int32
    assert mesh.corner_uv.dtype == np.float32
    assert mesh.corner_uv.shape == (*mesh.triangles.shape, 2)
    assert np.isfinite(mesh.vertices).all()
    assert np.isfinite(mesh.corner_uv).all()
    assert 4 <= len(mesh.triangles) <= 30_000
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose((high - low).max(), 2.0, rtol=1e-6)
    np.testing.assert_allclose(low + high, 0.0, atol=1e-6)
    surface = as_trimesh(mesh)
    assert open_edges(surface) == 0
    assert surface.volume > 0
    assert surface.area_faces.min() > 0


@pytest.mark.parametrize("name", SOLIDS)
def test_all_parts_of_a_shape_face_outwards(name: str) -> None:
    # A cavity is a part of negative volume, but never without the larger one around it.
    for seed in range(4):
        parts = as_trimesh(drawn(name, seed).mesh()).split(only_watertight=False)
        assert min(part.volume for part in parts) > 0


@pytest.mark.parametrize("name", SOLIDS)
@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_a_shape_survives_json_and_builds_the_same_mesh_again(name: str, seed: int) -> None:
    shape = drawn(name, seed)
    again = from_plain(json.loads(json.dumps(to_plain(shape))), SHAPES[name])
    assert again == shape
    one, two = shape.mesh(), again.mesh()
    assert np.array_equal(one.vertices, two.vertices)
    assert np.array_equal(one.triangles, two.triangles)
    assert np.array_equal(one.corner_uv, two.corner_uv)


@pytest.mark.parametrize("name", SOLIDS)
def test_two_draws_are_two_shapes(name: str) -> None:
    rng = np.random.default_rng(3)
    shapes = [SHAPES[name].sample(rng) for _ in range(20)]
    assert len(set(shapes)) == 20


@pytest.mark.parametrize("name", SOLIDS)
def test_texture_coordinates_are_in_local_units(name: str) -> None:
    """A texture is neither smeared nor squeezed: most of the surface is mapped at about its own size."""
    shape = drawn(name, 5)
    mesh = shape.mesh()
    # Metric shapes have theirs in metres.
    size = shape.frame.half_extent if isinstance(shape, MetricShape) else 1.0
    corners, uv = size * mesh.vertices[mesh.triangles], mesh.corner_uv.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    one, two = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    painted = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    ratio = painted / area
    well_mapped = (ratio > 0.3) & (ratio < 3.0)
    assert area[well_mapped].sum() > 0.7 * area.sum()


@pytest.mark.parametrize("name", ["Ellipsoid", "RoundedBox", "Blob", "TorusKnot", "Lathe", "Cylinder"])
def test_smooth_shapes_are_flagged_and_keep_their_creases(name: str) -> None:
    mesh = next(m for m in (drawn(name, seed).mesh() for seed in range(20)) if m.smooth)
    surface = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    # Vertices are split wherever the dihedral angle is sharp, so no shared edge is.
    assert np.degrees(surface.face_adjacency_angles).max() < 100.0


def test_volumes_of_the_classical_solids() -> None:
    def volume(shape: Shape) -> float:
        return float(as_trimesh(shape.mesh()).volume)

    assert volume(Box((1.0, 0.5, 0.25))) == pytest.approx(8 * 0.5 * 0.25)
    assert volume(Box((1.0, 1.0, 1.0), taper=0.5)) == pytest.approx(2 / 3 * (4 + 2 + 1))
    assert volume(Ellipsoid((1.0, 0.8, 0.5))) == pytest.approx(4 / 3 * np.pi * 0.4, rel=0.02)
    # A 48-sided prism of radius 1 and height 2.
    assert volume(Cylinder(1.0, 1.0, 48)) == pytest.approx(2 * 24 * np.sin(2 * np.pi / 48))
    assert volume(Cylinder(1.0, 0.0, 48)) == pytest.approx(2 / 3 * 24 * np.sin(2 * np.pi / 48))
    # Torus of ring 1 and tube 1/4, scaled to the cube by 1 / 1.25.
    assert volume(Torus(0.25, 360.0, 20)) == pytest.approx(2 * np.pi**2 / 16 / 1.25**3, rel=0.03)
    # 3 x 2 cells with square holes half a cell wide, scaled by 2 / 3.
    assert volume(HoledPlate(3, 2, 4, 0.5, 0.3)) == pytest.approx(6 * 0.75 * 0.3 * (2 / 3) ** 3)


def test_holes_go_through() -> None:
    plate = as_trimesh(HoledPlate(3, 2, 20, 0.6, 0.3).mesh())
    assert plate.euler_number == 2 - 2 * 6
    assert as_trimesh(Torus(0.25, 360.0, 20).mesh()).euler_number == 0
    assert as_trimesh(Lattice((1, 1, 1), 0.1).mesh()).body_count == 12


def test_the_middle_of_a_terrain_is_where_it_says() -> None:
    terrain = Terrain(0.1, 3.0, 1.0, 0.1, 40, 2.0, 7)
    mesh = terrain.mesh()
    above = mesh.vertices[np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]) < 1e-9]
    assert above[:, 2].max() == pytest.approx(terrain.middle_height())
    points = np.random.default_rng(0).uniform(-1, 1, (50, 2))
    origins = np.column_stack([points, np.full(50, 3.0)])
    rays = as_trimesh(mesh).ray
    hits, ray, _ = rays.intersects_location(origins, np.tile([0.0, 0.0, -1.0], (50, 1)), multiple_hits=False)
    expected = terrain.height(points[ray]) + terrain.middle_height()
    np.testing.assert_allclose(hits[:, 2], expected, atol=0.01)


def test_no_stone_of_a_ruined_wall_hangs_in_the_air() -> None:
    for seed in range(30):
        wall = BlockWall.sample(np.random.default_rng(seed))
        stones = as_trimesh(wall.mesh()).split(only_watertight=False)
        low, high = (np.array([stone.bounds[k] for stone in stones]) for k in (0, 1))
        step = float(np.median(high[:, 2] - low[:, 2]))
        for index in np.flatnonzero(low[:, 2] > low[:, 2].min() + 0.5 * step):
            under = np.abs(high[:, 2] - low[index, 2]) < 0.5 * step
            apart = np.maximum(low[index] - high[under], low[under] - high[index])[:, :2]
            assert (apart < 0.1 * step).all(axis=1).any(), seed

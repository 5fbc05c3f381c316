"""Soft bodies: distances to capsules, and the closed surfaces meshed from them."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.geometry.implicit_surfaces import blended_capsules, capsule_distances, surface_net

seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=20, deadline=None)
@given(seed=seeds)
def test_distances_to_capsules_are_those_to_the_nearest_of_many_balls(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, start, end = rng.normal(size=(30, 3)), rng.normal(size=(4, 3)), rng.normal(size=(4, 3))
    radius = rng.uniform(0.05, 0.5, 4)
    found = capsule_distances(points, start, end, radius, radius)
    share = np.linspace(0, 1, 2001)[:, None, None]
    centres = start + share * (end - start)
    brute = np.linalg.norm(points[None, :, None] - centres[:, None], axis=3).min(axis=0) - radius
    np.testing.assert_allclose(found, brute, atol=2e-3)


def _grid(half: float, cells: int) -> tuple[np.ndarray, float]:  # type: ignore[type-arg]
    line = np.linspace(-half, half, cells)
    return np.stack(np.meshgrid(line, line, line, indexing="ij"), -1), float(line[1] - line[0])


def test_the_surface_net_of_a_ball_is_that_ball() -> None:
    grid, step = _grid(1.3, 40)
    vertices, triangles = surface_net(np.linalg.norm(grid, axis=-1) - 1.0)
    ball = trimesh.Trimesh(vertices * step - 1.3, triangles, process=False)
    assert ball.is_watertight
    assert ball.euler_number == 2
    assert ball.volume == pytest.approx(4 / 3 * np.pi, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(ball.vertices, axis=1), 1.0, atol=0.5 * step**2 + 0.01)


def test_a_ring_keeps_its_hole() -> None:
    grid, step = _grid(1.4, 44)
    x, y, z = np.moveaxis(grid, -1, 0)
    vertices, triangles = surface_net(np.hypot(np.hypot(x, y) - 0.9, z) - 0.3)
    ring = trimesh.Trimesh(vertices * step, triangles, process=False)
    assert ring.is_watertight
    assert ring.euler_number == 0
    assert ring.volume == pytest.approx(2 * np.pi**2 * 0.9 * 0.09, rel=0.03)


@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_any_field_has_a_closed_outward_surface(seed: int) -> None:
    rng = np.random.default_rng(seed)
    field = np.full((9, 9, 9), 1.0)
    field[1:-1, 1:-1, 1:-1] = rng.normal(size=(7, 7, 7)) - 0.2
    vertices, triangles = surface_net(field)
    edges = Counter((int(a), int(b)) for t in triangles for a, b in zip(t, np.roll(t, -1), strict=True))
    assert all(edges[(b, a)] == count for (a, b), count in edges.items())
    corners = vertices[triangles]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume > 0


def test_a_field_without_an_inside_is_refused() -> None:
    with pytest.raises(ValueError, match="nowhere negative"):
        surface_net(np.ones((4, 4, 4)))


def test_blending_fills_the_crease_between_two_capsules() -> None:
    start, end = np.array([(0.0, 0, 0), (1.0, 0, 0)]), np.array([(0.0, 0, 1), (1.0, 0, 1)])
    radius = np.full(2, 0.45)
    between = np.array([(0.5, 0.0, 0.5), (0.0, 0.0, 0.5)])
    hard = capsule_distances(between, start, end, radius, radius).min(axis=1)
    soft = blended_capsules(between, start, end, radius, radius, 0.1)
    assert soft[0] == pytest.approx(hard[0] - 0.1 * np.log(2))
    assert soft[1] == pytest.approx(hard[1], abs=1e-4)

"""The painting blocks against plain numpy and a k-d tree."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from scenes.appearance.painting import finish, mix, smooth_step, to_bytes, unit_grid
from scenes.textures.cells import cellular_noise
from scenes.textures.collages import overlapping_shapes


@pytest.fixture
def picture() -> np.ndarray:
    """(3, 24, 40) with values beyond both ends."""
    return np.random.default_rng(0).uniform(-30, 300, (3, 24, 40)).astype(np.float32)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_smooth_steps_are_those_of_numpy(picture: np.ndarray, precision: type) -> None:
    value = picture.astype(precision)
    t = np.clip((value - np.float32(90)) / np.float32(70) + np.float32(0.5), 0, 1)
    stepped = smooth_step(value, 90, 70)
    np.testing.assert_array_equal(stepped, t * t * (3 - 2 * t))
    assert stepped.dtype == precision


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_mixing_blends_linearly_and_broadcasts(picture: np.ndarray, precision: type) -> None:
    color = np.array([[[200]], [[20]], [[90]]], np.float32)
    cover = np.random.default_rng(1).random((24, 40)).astype(precision)
    np.testing.assert_array_equal(mix(picture, color, cover), (color - picture) * cover + picture)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_grain_and_bytes_are_those_of_numpy(picture: np.ndarray, precision: type) -> None:
    picture = picture.astype(precision)
    fine = np.random.default_rng(2).random((24, 40), np.float32) - np.float32(0.5)
    fine = fine * np.float32(np.sqrt(12.0))
    pairs = fine + np.roll(fine, 1, 0)
    noise = (pairs + np.roll(pairs, 1, 1)) * np.float32(0.4 * 0.1) + np.float32(0.6 * 0.1) * fine + 1
    expected = (picture + np.float32(12)) * noise - np.float32(12)
    whole = np.clip(expected + np.float32(0.5), 0, 255).astype(np.uint8).transpose(1, 2, 0)
    np.testing.assert_array_equal(finish(picture, np.random.default_rng(2), 0.1), whole)
    rounded = np.clip(picture + np.float32(0.5), 0, 255).astype(np.uint8).transpose(1, 2, 0)
    np.testing.assert_array_equal(to_bytes(picture), rounded)


def test_nearest_seeds_are_the_nearest_of_the_periodic_points() -> None:
    cells, jitter = 5, 0.8
    x, y = unit_grid(48)
    cell, first, second = cellular_noise(np.random.default_rng(3), x, y, cells, jitter)
    points = 0.5 + jitter * np.random.default_rng(3).uniform(-0.5, 0.5, (2, cells, cells))
    grid = np.stack([points[0] + np.arange(cells), points[1] + np.arange(cells)[:, None]], -1).reshape(-1, 2)
    tree = cKDTree(grid, boxsize=cells)
    distance, index = tree.query(np.stack([x, y], -1) * cells, k=2)
    np.testing.assert_allclose(first, distance[..., 0], atol=1e-5)
    np.testing.assert_allclose(second, distance[..., 1], atol=1e-5)
    apart = distance[..., 1] - distance[..., 0] > 1e-4
    np.testing.assert_array_equal(cell[apart], index[..., 0][apart])


def test_overlapping_shapes_wrap_around_and_the_last_is_on_top() -> None:
    size, radii = 32, np.array([6.0, 5.0, 4.0])
    top, _ = overlapping_shapes(np.random.default_rng(4), size, radii, 0)
    rng = np.random.default_rng(4)
    centres = rng.integers(0, size, (3, 2))
    rng.uniform(0, 2 * np.pi, 3)
    rows, columns = np.mgrid[:size, :size]
    for number, (centre, radius) in enumerate(zip(centres, radii, strict=True), 1):
        away = [(p - c + size // 2) % size - size // 2 for p, c in zip((rows, columns), centre, strict=True)]
        assert not (top[np.hypot(*away) > radius + 1e-3] == number).any()
        assert (top == number).any()
    last = [(p - c + size // 2) % size - size // 2 for p, c in zip((rows, columns), centres[-1], strict=True)]
    # Squeezed discs keep at least two fifths of their radius.
    assert (top[np.hypot(*last) < 0.4 * radii[-1]] == 3).all()

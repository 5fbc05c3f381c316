"""Streaks of rain against the pinhole camera's own formula."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from datagen.rendering import rain as rain_module
from datagen.rendering.rain import FARTHEST_M, NEAREST_M, streaks, with_streaks
from scenes.spec import Rain, StereoCamera, Trajectory

CAMERA = StereoCamera(320, 200, 24.0, 0.5, Trajectory.static())
"""Looks along -z of the world, so that the world's y axis is up in the picture."""
SKY = np.zeros((200, 320))
RAIN = Rain(2.0, (0.0, -0.3, 0.0), 0.004, 0.8)


def one_drop(monkeypatch: pytest.MonkeyPatch, place: tuple[float, float, float]) -> None:
    monkeypatch.setattr(rain_module, "_drops", lambda rng, rain, camera: np.array([place]))  # noqa: ARG005


def centroid(share: NDArray[np.float32]) -> tuple[float, float]:
    """x and y in pixels."""
    rows, columns = np.indices(share.shape) + 0.5
    return float((columns * share).sum() / share.sum()), float((rows * share).sum() / share.sum())


@pytest.mark.parametrize("place", [(0.3, 0.2, -3.0), (-0.4, -0.5, -5.0), (0.9, 0.1, -8.0)])
def test_a_drop_is_where_a_pinhole_camera_sees_it_in_both_views(
    monkeypatch: pytest.MonkeyPatch, place: tuple[float, float, float]
) -> None:
    one_drop(monkeypatch, place)
    focal_px = 24.0 / 32.0 * 320
    x, y, depth = place[0], place[1], -place[2]
    left, right = (streaks(RAIN, CAMERA, SKY, view, 0, 1) for view in ("left", "right"))
    assert centroid(left) == pytest.approx((160 + focal_px * x / depth, 100 - focal_px * y / depth), abs=0.3)
    assert centroid(left)[0] - centroid(right)[0] == pytest.approx(focal_px * 0.5 / depth, abs=0.15)
    assert centroid(left)[1] == pytest.approx(centroid(right)[1], abs=0.05)
    rows = np.flatnonzero((left > 0.02).any(axis=1))
    assert np.ptp(rows) == pytest.approx(focal_px * 0.3 / depth, abs=2.5)
    assert left.max() <= 0.8 * min(1.0, 0.004 * focal_px / depth) + 0.01


def test_what_is_nearer_than_a_drop_hides_it(monkeypatch: pytest.MonkeyPatch) -> None:
    one_drop(monkeypatch, (0.0, 0.0, -4.0))
    focal_px = 240.0
    for depth, seen in ((4.2, True), (3.8, False)):
        wall = np.full((200, 320), focal_px * 0.5 / depth)
        assert streaks(RAIN, CAMERA, wall, "left", 0, 1).any() == seen


def test_drops_fill_the_volume_evenly_and_are_new_in_every_frame() -> None:
    drops = rain_module._drops(np.random.default_rng(0), RAIN, CAMERA)
    across, high, depth = 2 * 16.0 / 24.0, 2 * 10.0 / 24.0, -drops[:, 2]
    volume = across * high * (FARTHEST_M**3 - NEAREST_M**3) / 3
    assert len(drops) == pytest.approx(RAIN.drops_per_m3 * volume, rel=0.1)
    shares = np.histogram(depth**3, bins=5, range=(NEAREST_M**3, FARTHEST_M**3))[0] / len(drops)
    np.testing.assert_allclose(shares, 0.2, atol=0.04)
    first, again, later = (streaks(RAIN, CAMERA, SKY, "left", frame, 7) for frame in (0, 0, 1))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, later)
    assert 0.005 < (first > 0).mean() < 0.5


def test_streaks_add_the_light_of_the_brighter_half_and_nothing_elsewhere() -> None:
    radiance = np.full((200, 320, 3), 0.1, np.float32)
    radiance[:50] = 1.0
    share = streaks(RAIN, CAMERA, SKY, "left", 0, 3)
    wet = with_streaks(radiance, RAIN, CAMERA, SKY, "left", 0, 3)
    assert np.array_equal(wet[share == 0], radiance[share == 0])
    below = share[60:] > 0
    assert (wet[60:][below] > 0.1).all()
    assert wet.max() <= 1.0 + 1e-6

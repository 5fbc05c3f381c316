"""Depths and points of disparities, held against OpenCV's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from datagen.cameras.calibration import Calibration
from datagen.cameras.reprojection import depth_of_disparity, points_of_depth


@given(
    st.floats(50, 3000),
    st.floats(-20, 20),
    st.floats(0.01, 2),
    st.integers(0, 2**32 - 1),
)
def test_points_are_opencvs(focal: float, doffs: float, baseline: float, seed: int) -> None:
    """`cv2.reprojectImageTo3D` with the Q of such a rig gives the same points."""
    cx, cy = 3.25, 2.5
    rig = Calibration(focal, focal, cx, cx + doffs, cy, baseline, (8, 6))
    disparity = np.random.default_rng(seed).uniform(25, 90, (6, 8)).astype(np.float32)
    q = np.array([[1, 0, 0, -cx], [0, 1, 0, -cy], [0, 0, 0, focal], [0, 0, 1 / baseline, doffs / baseline]])
    expected = cv2.reprojectImageTo3D(disparity, q)
    points = points_of_depth(depth_of_disparity(disparity, rig), rig)
    np.testing.assert_allclose(points, expected, rtol=2e-4, atol=1e-6)


def test_oblong_pixels_and_another_size() -> None:
    rig = Calibration(100, 200, 1, 1, 1, 0.5, (3, 2))
    points = points_of_depth(np.full((2, 3), 4.0), rig)
    np.testing.assert_allclose(points[0, 2], [0.04, -0.02, 4])
    with pytest.raises(ValueError, match="the disparity is 4x2 and the calibration is of images of 3x2"):
        depth_of_disparity(np.ones((2, 4)), rig)


def test_a_scaled_calibration_sees_the_same_points() -> None:
    """A pixel's centre of pictures of half the size lies between four centres of the full ones."""
    full = Calibration(100, 100, 3, 3.5, 2, 0.5, (8, 6))
    half = full.scaled_to((4, 3))
    depth = np.full((3, 4), 7.0)
    large = points_of_depth(np.full((6, 8), 7.0), full).reshape(3, 2, 4, 2, 3).mean((1, 3))
    np.testing.assert_allclose(points_of_depth(depth, half), large, atol=1e-12)
    assert half.doffs == pytest.approx(full.doffs / 2)
    with pytest.raises(ValueError, match="have another shape"):
        full.scaled_to((4, 4))

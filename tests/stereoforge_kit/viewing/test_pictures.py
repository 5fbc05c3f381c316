"""Pictures: every colour code says what it should, and no value is lost silently."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stereoforge_kit.viewing import (
    anaglyph,
    confidence_picture,
    disparity_picture,
    enlarged,
    error_picture,
    gradient_picture,
    index_picture,
    occlusion_picture,
    shrunk,
    side_by_side,
    stacked,
)
from stereoforge_kit.viewing.pictures import INVALID_COLOR, LUMA

NAN = float("nan")
maps = arrays(np.float32, (3, 4), elements=st.one_of(st.floats(-1e4, 1e4, width=32), st.just(NAN)))


@settings(deadline=None)
@given(maps)
def test_every_map_gives_a_picture_with_holes_where_values_are_missing(values):
    gradient = np.stack([values, values[::-1]], axis=2)
    for picture, hole in (
        (disparity_picture(values, 50), np.isnan(values)),
        (confidence_picture(values), np.isnan(values)),
        (error_picture(values, 1), np.isnan(values)),
        (gradient_picture(gradient), np.isnan(gradient).any(axis=2)),
    ):
        assert picture.dtype == np.uint8
        assert picture.shape == (3, 4, 3)
        np.testing.assert_array_equal((picture == INVALID_COLOR).all(axis=2), hole)


@pytest.mark.parametrize("paint", [lambda v: disparity_picture(v, 1.0), confidence_picture])
def test_brightness_grows_with_the_value(paint):
    picture = paint(np.linspace(0, 1, 64)[None])
    assert (np.diff(picture[0] @ LUMA) > -0.5).all()
    assert picture[0, -1] @ LUMA - picture[0, 0] @ LUMA > 120


def test_disparities_share_a_scale_when_given_one_maximum():
    near, far = (disparity_picture(np.full((1, 1), d), 40.0) for d in (30.0, 10.0))
    both = disparity_picture([[30.0, 10.0]], 40.0)
    np.testing.assert_array_equal(both[0], [near[0, 0], far[0, 0]])
    np.testing.assert_array_equal(disparity_picture([[20.0, 40.0]]), disparity_picture([[20.0, 40.0]], 40.0))


def test_bad_pixels_are_red_and_good_ones_grey():
    picture = error_picture([[0.0, 1.0, -1.0, 1.001, -5.0, np.inf]], threshold=1.0).astype(int)[0]
    for grey in picture[:3]:
        assert grey.max() == grey.min() >= 200
    for red in picture[3:]:
        assert red[0] > red[1:].max() + 80
    assert picture[3] @ LUMA > picture[4] @ LUMA > picture[5] @ LUMA


def test_occlusion_tints_its_two_classes_apart_and_leaves_the_rest_grey():
    image = np.full((1, 3, 3), (90, 120, 60), np.uint8)
    visible, occluded, outside = occlusion_picture([[0, 1, 2]], image)[0].astype(int)
    assert visible.max() == visible.min()
    assert occluded[0] > occluded[2] + 50
    assert outside[2] > outside[0] + 50


def test_gradient_hue_is_direction_and_saturation_is_size():
    right, left, down, flat, double = gradient_picture(
        [[[0.25, 0], [-0.25, 0], [0, 0.25], [0, 0], [0.5, 0]]], maximum=0.5
    )[0].astype(int)
    np.testing.assert_array_equal(flat, 255)
    assert right.argmax() == 0
    assert left.argmin() == 0
    assert down[1] == down.max() > down[2]
    assert np.ptp(double) > np.ptp(right) > 50


def test_indices_have_colours_of_their_own():
    picture = index_picture(np.arange(60).reshape(6, 10))
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) == 60
    assert picture[0, 0].max() < 60


def test_anaglyph_takes_red_from_the_left_eye():
    left, right = np.full((2, 2, 3), 200, np.uint8), np.full((2, 2, 3), (1, 2, 3), np.uint8)
    np.testing.assert_array_equal(anaglyph(left, right)[0, 0], (200, 2, 3))


def test_joining_keeps_every_picture_and_the_gaps():
    first, second = np.zeros((4, 3, 3), np.uint8), np.full((4, 5, 3), 9, np.uint8)
    row = side_by_side([first, second], gap=2)
    assert row.shape == (4, 10, 3)
    np.testing.assert_array_equal(row[0, :, 0], [0] * 3 + [255] * 2 + [9] * 5)
    column = stacked([second, second + 1], gap=1, color=0)
    np.testing.assert_array_equal(column[:, 0, 0], [9] * 4 + [0] + [10] * 4)


def test_enlarging_and_shrinking_are_inverse():
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, 3), np.uint8)
    large = enlarged(picture, 3)
    assert large.shape == (15, 21, 3)
    np.testing.assert_array_equal(shrunk(large, 7), picture)
    np.testing.assert_array_equal(shrunk(picture, 7), picture)


@pytest.mark.parametrize(("size", "longest"), [((1, 900), 100), ((333, 517), 100), ((50, 50), 49)])
def test_shrinking_meets_the_limit(size, longest):
    assert max(shrunk(np.zeros((*size, 3), np.uint8), longest).shape) <= longest


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: disparity_picture(np.zeros(3)), r"disparity must be \(H, W\)"),
        (lambda: disparity_picture(np.zeros((2, 2)), 0), "maximum disparity"),
        (lambda: error_picture(np.zeros((2, 2)), 0), "threshold"),
        (lambda: gradient_picture(np.zeros((2, 2))), r"\(H, W, 2\)"),
        (lambda: gradient_picture(np.zeros((2, 2, 2)), -1), "maximum gradient"),
        (lambda: occlusion_picture(np.zeros((2, 2)), np.zeros((2, 3, 3))), "differ in size"),
        (lambda: anaglyph(np.zeros((2, 2, 3)), np.zeros((2, 3, 3))), "differ in size"),
        (lambda: side_by_side([]), "at least one"),
        (lambda: stacked([np.zeros((2, 2, 3)), np.zeros((2, 3, 3))]), "share their width"),
        (lambda: shrunk(np.zeros((2, 2)), 5), r"\(H, W, 3\)"),
    ],
)
def test_wrong_inputs_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()

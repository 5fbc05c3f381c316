"""Classical matching against pairs whose disparity is known, and holes filled by hand."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from stereoforge_kit.matching import (
    INCONSISTENT,
    SGBMParameters,
    fill_background,
    fill_nearest,
    left_right_consistency,
    match_both,
    match_sgbm,
)
from tests.training.synthetic import random_layer, render
from training.networks import left_right_consistency as consistency_of_tensors

NAN = np.nan


@pytest.fixture(scope="module")
def pair():
    rng = np.random.default_rng(1)
    layers = [random_layer(rng, 6.0, (0.02, 0.01)), random_layer(rng, 20.0, box=(60, 110, 20, 60))]
    return render(layers, 80, 160)


def test_sgbm_finds_the_disparity_of_both_views(pair):
    found = match_both(pair.left, pair.right, SGBMParameters(max_disparity_px=32))
    for got, truth in zip(found, (pair.disparity_left, pair.disparity_right), strict=True):
        known = np.isfinite(got)
        assert known.mean() > 0.7
        assert np.median(np.abs(got - truth)[known]) < 0.2
        assert (np.abs(got - truth)[known] > 1).mean() < 0.1


def test_sgbm_matches_up_to_the_left_border(pair):
    got = match_sgbm(pair.left, pair.right, SGBMParameters(max_disparity_px=32))
    inside = np.arange(160) - pair.disparity_left >= 0
    border = inside & (np.arange(160) < 32)
    assert np.isfinite(got[border]).mean() > 0.7
    noise = np.random.default_rng(0).integers(0, 256, (2, 40, 90, 3), np.uint8)
    found = match_sgbm(*noise, SGBMParameters(max_disparity_px=64, uniqueness_percent=0, speckle_px=0))
    assert np.isfinite(found).any()
    assert (np.nan_to_num(found) < np.arange(90) + 1).all()


def test_sgbm_refuses_what_it_cannot_match(pair):
    with pytest.raises(ValueError, match="differ in size"):
        match_sgbm(pair.left, pair.right[:-1])
    with pytest.raises(ValueError, match="uint8"):
        match_sgbm(pair.left.astype(np.float32), pair.right)
    with pytest.raises(ValueError, match="odd"):
        SGBMParameters(block_px=4)
    with pytest.raises(ValueError, match="larger"):
        SGBMParameters(small_penalty=9, large_penalty=8)


def test_consistency_is_that_of_tensors_and_knows_holes():
    rng = np.random.default_rng(0)
    left, right = rng.uniform(0, 12, (2, 5, 30)).astype(np.float32)
    expected = consistency_of_tensors(torch.from_numpy(left)[None, None], torch.from_numpy(right)[None, None])
    np.testing.assert_array_equal(left_right_consistency(left, right), expected[0, 0])
    left = np.array([[NAN, 1.0, 1.0, 2.0]], np.float32)
    right = np.array([[1.5, NAN, 0.0, 0.0]], np.float32)
    np.testing.assert_array_equal(
        left_right_consistency(left, right), [[INCONSISTENT, 0.5, INCONSISTENT, INCONSISTENT]]
    )


def test_holes_take_the_nearest_or_the_background():
    holes = np.array([[NAN, 5.0, NAN, NAN, 2.0, NAN], [NAN] * 6, [7.0] * 6], np.float32)
    np.testing.assert_array_equal(fill_nearest(holes)[0], [5, 5, 5, 2, 2, 2])
    background = fill_background(holes)
    np.testing.assert_array_equal(background[0], [5, 5, 2, 2, 2, 2])
    assert np.isfinite(background).all()
    assert np.isnan(fill_nearest(np.full((2, 3), NAN))).all()
    assert np.isnan(fill_background(np.full((2, 3), NAN, np.float32))).all()

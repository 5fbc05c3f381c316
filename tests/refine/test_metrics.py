"""Metrics against loops, closed forms and numerical integration."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from refine.metrics import (
    ErrorPool,
    GradientPool,
    bad_pixel_rate,
    end_point_error,
    forward_gradient,
    gradient_error,
    kitti_d1,
    optimal_auc,
    optimal_curve,
    smooth_mask,
    sparsification_curve,
)

NAN = float("nan")


@st.composite
def disparity_cases(draw):
    """Estimate, ground truth and mask of one size, with holes in both and errors on both sides of 1 pixel."""
    seed = draw(st.integers(0, 10**6))
    rng = np.random.default_rng(seed)
    size = (draw(st.integers(1, 7)), draw(st.integers(1, 7)))
    truth = rng.integers(0, 50, size).astype(float)
    estimate = truth + rng.choice([0.0, 0.5, 1.0, -1.0, 1.25, -4.0, NAN], size)
    truth[rng.random(size) < 0.2] = NAN
    return estimate, truth, rng.random(size) < 0.7


@settings(deadline=None)
@given(disparity_cases(), st.sampled_from([0.75, 1.0, 3.0]))
def test_errors_are_what_a_loop_counts(case, threshold):
    estimate, truth, mask = case
    counted = bad = 0
    errors = []
    for d, t, m in zip(estimate.ravel(), truth.ravel(), mask.ravel(), strict=True):
        if not m or math.isnan(t):
            continue
        counted += 1
        bad += math.isnan(d) or abs(d - t) > threshold
        if not math.isnan(d):
            errors.append(abs(d - t))
    expected_bad = bad / counted if counted else NAN
    expected_error = sum(errors) / len(errors) if errors else NAN
    assert bad_pixel_rate(estimate, truth, threshold, mask) == pytest.approx(expected_bad, nan_ok=True)
    assert end_point_error(estimate, truth, mask) == pytest.approx(expected_error, nan_ok=True)


def test_an_error_of_exactly_the_threshold_is_good():
    assert bad_pixel_rate([[11.0, 11.001]], [[10.0, 10.0]]) == 0.5


def test_an_empty_mask_gives_nan():
    nothing = np.zeros((2, 2), bool)
    zeros = np.zeros((2, 2))
    assert math.isnan(bad_pixel_rate(zeros, zeros, mask=nothing))
    assert math.isnan(end_point_error(zeros, zeros, nothing))
    assert math.isnan(gradient_error(np.zeros((2, 2, 2)), np.zeros((2, 2, 2)), nothing))
    assert math.isnan(sparsification_curve(zeros, zeros, zeros, mask=nothing).auc)
    assert math.isnan(kitti_d1(zeros, np.full((2, 2), NAN)).all)


@settings(deadline=None)
@given(disparity_cases(), disparity_cases())
def test_pooling_is_by_pixel_and_merging_is_adding(first, second):
    together, apart = ErrorPool(), ErrorPool()
    for estimate, truth, mask in (first, second):
        together.add(estimate, truth, mask)
        apart.merge(ErrorPool().add(estimate, truth, mask))
    assert together == apart
    flat = [np.concatenate([a.ravel(), b.ravel()])[None] for a, b in zip(first, second, strict=True)]
    assert together.bad_pixel_rate == pytest.approx(bad_pixel_rate(*flat[:2], mask=flat[2]), nan_ok=True)
    assert together.end_point_error == pytest.approx(end_point_error(*flat), nan_ok=True)


def test_forward_gradient_of_a_small_map():
    found = forward_gradient([[1.0, 3.0, 2.0], [5.0, 5.0, 0.0]])
    np.testing.assert_array_equal(found[..., 0], [[2, -1, NAN], [0, -5, NAN]])
    np.testing.assert_array_equal(found[..., 1], [[4, 2, -2], [NAN, NAN, NAN]])


def test_gradient_error_adds_the_means_of_the_two_directions():
    truth = forward_gradient([[1.0, 3.0, 2.0], [5.0, 5.0, 0.0]])
    estimate = np.nan_to_num(truth) + np.array([0.25, -0.5])
    assert gradient_error(estimate, truth) == pytest.approx(0.75)
    mask = np.array([[True, False, False], [False, False, False]])
    estimate[0, 1] = 100
    assert gradient_error(estimate, truth, mask) == pytest.approx(0.75)


def test_gradient_error_against_a_loop():
    rng = np.random.default_rng(0)
    pool, sums, counts = GradientPool(), [0.0, 0.0], [0, 0]
    for _ in range(3):
        truth, estimate = rng.normal(0, 1, (2, 5, 6, 2))
        truth[rng.random((5, 6, 2)) < 0.2] = NAN
        mask = rng.random((5, 6)) < 0.6
        pool.add(estimate, truth, mask)
        for y, x, c in np.ndindex(5, 6, 2):
            if mask[y, x] and not math.isnan(truth[y, x, c]):
                sums[c] += abs(estimate[y, x, c] - truth[y, x, c])
                counts[c] += 1
    assert pool.gradient_error == pytest.approx(sums[0] / counts[0] + sums[1] / counts[1])


def test_smooth_mask_leaves_out_pixels_with_either_difference_above_the_threshold():
    gradient = np.array([[[0.5, 0.5], [1.5, 0.0], [0.0, -1.5], [1.0, NAN], [NAN, NAN]]])
    np.testing.assert_array_equal(smooth_mask(gradient), [[True, False, False, True, False]])
    np.testing.assert_array_equal(smooth_mask(gradient, 2.0), [[True, True, True, True, False]])


def remaining_bad_rates(bad, confidence, steps, orders=400):
    """Removing pixels one by one, least confident first, ties in random order, by simulation."""
    shuffler = random.Random(1)
    rates = np.zeros(steps)
    for _ in range(orders):
        order = sorted(range(len(bad)), key=lambda i: (confidence[i], shuffler.random()))
        for step in range(steps):
            kept = order[round(step / steps * len(bad)) :]
            rates[step] += sum(bad[i] for i in kept) / len(kept)
    return rates / orders


def test_sparsification_without_ties_follows_the_removal_exactly():
    rng = np.random.default_rng(2)
    error, confidence = rng.exponential(1, (5, 8)), rng.permutation(40).reshape(5, 8)
    truth = np.full((5, 8), 10.0)
    curve = sparsification_curve(truth + error, truth, confidence, steps=40)
    expected = remaining_bad_rates((error > 1).ravel(), confidence.ravel(), 40, orders=1)
    np.testing.assert_allclose(curve.bad_rate[:-1], expected)
    assert curve.bad_rate[-1] == curve.bad_rate[-2]


def test_sparsification_with_ties_is_the_expectation_over_their_orders():
    rng = np.random.default_rng(3)
    error, confidence = rng.exponential(1, (4, 6)), rng.integers(0, 4, (4, 6))
    truth = np.zeros((4, 6))
    curve = sparsification_curve(truth + error, truth, confidence, steps=24)
    expected = remaining_bad_rates((error > 1).ravel(), confidence.ravel(), 24, orders=4000)
    np.testing.assert_allclose(curve.bad_rate[:-1], expected, atol=0.02)


def test_a_constant_confidence_is_a_random_order():
    truth = np.zeros((10, 10))
    estimate = np.where(np.arange(100).reshape(10, 10) < 30, 5.0, 0.0)
    curve = sparsification_curve(estimate, truth, np.ones((10, 10)))
    np.testing.assert_allclose(curve.bad_rate, 0.3)
    assert curve.auc == pytest.approx(0.3)


@pytest.mark.parametrize("rate", [0.0, 0.05, 0.2345, 0.5, 0.9, 0.99])
def test_optimal_auc_is_the_integral_of_the_optimal_curve(rate):
    integral, _ = quad(lambda r: max(rate - r, 0) / (1 - r), 0, 1, points=[rate])
    assert optimal_auc(rate) == pytest.approx(integral, abs=1e-7)
    assert optimal_curve(rate, steps=20000).auc == pytest.approx(integral, abs=1e-4)


def test_optimal_auc_at_its_ends():
    assert optimal_auc(1.0) == 1.0
    assert optimal_curve(1.0).auc == pytest.approx(1.0)
    assert math.isnan(optimal_auc(NAN))
    with pytest.raises(ValueError, match=r"1\.2"):
        optimal_auc(1.2)


def test_the_error_itself_is_the_optimal_confidence():
    rng = np.random.default_rng(4)
    error = rng.exponential(0.8, (60, 70))
    truth = np.full((60, 70), 20.0)
    curve = sparsification_curve(truth + error, truth, -error)
    rate = bad_pixel_rate(truth + error, truth)
    np.testing.assert_allclose(curve.bad_rate, optimal_curve(rate).bad_rate, atol=1e-3)
    assert curve.auc == pytest.approx(optimal_auc(rate), abs=1e-3)
    assert sparsification_curve(truth + error, truth, error).auc > rate


def test_missing_estimates_are_bad_when_sparsifying():
    curve = sparsification_curve([[NAN, 1.0]], [[1.0, 1.0]], [[0.0, 1.0]], steps=2)
    np.testing.assert_allclose(curve.bad_rate, [0.5, 0, 0])


def test_kitti_d1_needs_both_limits_exceeded():
    truth = np.array([[10.0, 10.0, 100.0, 100.0, 50.0, NAN]])
    estimate = np.array([[13.0, 13.1, 104.9, 105.1, NAN, 0.0]])
    objects = np.array([[0, 0, 0, 7, 7, 7]])
    rates = kitti_d1(estimate, truth, objects)
    assert rates.background == pytest.approx(1 / 3)
    assert rates.foreground == pytest.approx(1.0)
    assert rates.all == pytest.approx(3 / 5)
    assert math.isnan(kitti_d1(estimate, truth).foreground)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: end_point_error(np.zeros((2, 3)), np.zeros((3, 2))), "alike"),
        (lambda: end_point_error(np.zeros((2, 3)), np.zeros((2, 3)), np.ones((2, 3))), "mask must be bool"),
        (lambda: gradient_error(np.zeros((2, 3)), np.zeros((2, 3))), r"\(H, W, 2\)"),
        (
            lambda: sparsification_curve(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(6)),
            "confidence has shape",
        ),
        (lambda: kitti_d1(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(6)), "object map"),
    ],
)
def test_wrong_shapes_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()

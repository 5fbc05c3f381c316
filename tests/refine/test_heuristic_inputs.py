"""Confidence and slopes without networks, on a scene whose answers are known."""

from __future__ import annotations

import numpy as np

from refine.heuristic_inputs import UNCONFIRMED, consistency_confidence, local_gradients
from stereoforge_kit.matching import SGBMParameters, left_right_consistency, match_both
from tests.refine.worlds import random_problem
from tests.training.synthetic import random_pair


def test_confidence_falls_with_inconsistency_and_without_texture():
    disparity = np.full((20, 30), 5.0, np.float32)
    disparity[0, 0] = np.nan
    consistency = np.zeros((20, 30), np.float32)
    consistency[:, 10:20] = 3.0
    consistency[:, 20:] = -1.0
    noise = random_problem(20, 30, 0, "noise").image
    flat = np.full((20, 30, 3), 90, np.uint8)
    textured = consistency_confidence(disparity, consistency, noise)
    assert textured[0, 0] == 0
    assert (textured[:, 1:10] > 0.9).all()
    np.testing.assert_allclose(textured[:, 10:20], np.exp(-4.5), atol=0.005)
    np.testing.assert_allclose(textured[:, 20:], UNCONFIRMED, atol=0.01)
    assert (consistency_confidence(disparity, consistency, flat)[:, 1:10] < 0.21).all()


def test_confidence_sorts_what_matching_gets_wrong():
    pair = random_pair(np.random.default_rng(3), 64, 128)
    left, right = match_both(pair.left, pair.right, SGBMParameters(max_disparity_px=48))
    confidence = consistency_confidence(left, left_right_consistency(left, right), pair.left)
    known = np.isfinite(left)
    wrong = known & (np.abs(left - pair.disparity_left) > 1)
    assert confidence[known & ~wrong].mean() > 1.5 * confidence[wrong].mean()


def test_slopes_of_planes_are_found_through_noise_and_edges():
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:60, :80].astype(np.float32)
    near = x > 45
    truth = np.where(near, 30 - 0.2 * x + 0.1 * y, 5 + 0.05 * x - 0.03 * y)
    image = np.where(near[..., None], [200, 80, 60], [60, 90, 160]).astype(np.uint8)
    disparity = (truth + rng.normal(0, 0.1, truth.shape)).astype(np.float32)
    confidence = (rng.random(truth.shape) < 0.8).astype(np.float32)
    disparity[confidence == 0] += 10
    slopes = local_gradients(disparity, confidence, image)
    inner = (slice(8, -8), slice(8, -8))
    expected = np.where(near[..., None], [-0.2, 0.1], [0.05, -0.03])
    assert np.abs(slopes - expected)[inner].mean() < 0.01
    assert np.abs(slopes - expected)[inner].max() < 0.05
    assert (local_gradients(disparity, np.zeros_like(confidence), image) == 0).all()

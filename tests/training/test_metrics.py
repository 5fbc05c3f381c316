"""Validation figures of tensors are those of `refine.metrics`."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from refine import metrics
from training.metrics import (
    AUC_STEPS,
    bad_pixel_rate,
    end_point_error,
    forward_gradient,
    gradient_error,
    sparsification_auc,
)


@settings(max_examples=50, deadline=None)
@given(
    size=st.tuples(st.integers(1, 3), st.integers(1, 6), st.integers(1, 6)),
    threshold=st.sampled_from([0.5, 1.0, 3.0]),
    known=st.sampled_from([0.0, 0.7, 1.0]),
    seed=st.integers(0, 10**6),
)
def test_figures_of_tensors_are_those_of_the_same_pixels_in_numpy(
    size: tuple[int, int, int], threshold: float, known: float, seed: int
) -> None:
    """Of a batch, whose images are laid side by side: with holes in the ground truth, and with no ground truth."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 9, size).astype(np.float32)
    disparity = (truth + rng.choice([0.0, 0.5, 1.0, -1.25, 4.0, np.nan], size)).astype(np.float32)
    truth[rng.random(size) > known] = np.nan
    confidence = rng.integers(0, 4, size).astype(np.float32)
    slopes, true_slopes = rng.choice([0.0, 0.25, -1.0, 2.0, np.nan], (2, *size, 2)).astype(np.float32)

    maps = [torch.from_numpy(each)[:, None] for each in (disparity, truth, confidence)]
    wide = [np.concatenate(each, axis=1) for each in (disparity, truth, confidence)]
    gradients = [torch.from_numpy(each).permute(0, 3, 1, 2) for each in (slopes, true_slopes)]
    wide_slopes, wide_true_slopes = (np.concatenate(each, axis=1) for each in (slopes, true_slopes))
    smooth = metrics.smooth_mask(wide_true_slopes, threshold)
    got = [
        end_point_error(*maps[:2]),
        bad_pixel_rate(*maps[:2], threshold),
        gradient_error(*gradients, threshold),
        sparsification_auc(maps[2], *maps[:2], threshold),
    ]
    expected = [
        metrics.end_point_error(*wide[:2]),
        metrics.bad_pixel_rate(*wide[:2], threshold),
        metrics.gradient_error(wide_slopes, wide_true_slopes, smooth),
        metrics.sparsification_curve(*wide, threshold, steps=AUC_STEPS).auc,
    ]
    assert got == pytest.approx(expected, nan_ok=True)
    for image, gradient in zip(disparity, forward_gradient(maps[0]), strict=True):
        np.testing.assert_array_equal(gradient.permute(1, 2, 0), metrics.forward_gradient(image))


def test_gradient_error_counts_smooth_pixels() -> None:
    truth = torch.tensor([[[[0.0, 0.5, 3.0, torch.nan]], [[0.25, -0.5, 0.0, torch.nan]]]])
    gradient = torch.tensor([[[[0.1, 0.5, 0.0, 0.0]], [[0.0, 0.0, 0.0, 0.0]]]])
    assert gradient_error(gradient, truth, 1.0) == pytest.approx((0.1 + 0.25 + 0.5) / 2)

"""Every loss against a loop over pixels, missing ground truth included."""

import math

import numpy as np
import pytest
import torch

from training.losses import (
    STAGE_WEIGHTS,
    STATIC_WEIGHTS,
    confidence_cross_entropy,
    disparity_l1,
    downsample_disparity,
    gradient_aware_l1,
    masked_gradient_l1,
    multiscale_l1,
    stage_weights,
)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def truth_with_gaps(rng: np.random.Generator, height: int = 8, width: int = 12) -> np.ndarray:
    truth = rng.uniform(0, 20, (2, 1, height, width))
    truth[rng.random(truth.shape) < 0.3] = np.nan
    truth[0, 0, :4, :4] = np.nan
    return truth


def test_downsampling_averages_valid_pixels_only(rng: np.random.Generator) -> None:
    truth = truth_with_gaps(rng)
    got = downsample_disparity(torch.from_numpy(truth), (2, 3)).numpy()
    for b, _, y, x in np.ndindex(2, 1, 2, 3):
        area = truth[b, 0, 4 * y : 4 * y + 4, 4 * x : 4 * x + 4]
        if np.isnan(area).all():
            assert np.isnan(got[b, 0, y, x])
        else:
            assert got[b, 0, y, x] == pytest.approx(np.nanmean(area))
    assert np.isnan(got[0, 0, 0, 0])


def test_multiscale_loss(rng: np.random.Generator) -> None:
    truth = truth_with_gaps(rng)
    predictions = [rng.normal(5, 6, (2, 1, 8 // s, 12 // s)) for s in (4, 2, 1)]
    weights = (0.5, 0.0, 2.0)
    expected = 0.0
    for prediction, scale, weight in zip(predictions, (4, 2, 1), weights, strict=True):
        errors = []
        for b, _, y, x in np.ndindex(prediction.shape):
            area = truth[b, 0, scale * y : scale * (y + 1), scale * x : scale * (x + 1)]
            if not np.isnan(area).all():
                errors.append(abs(max(prediction[b, 0, y, x], 0) - np.nanmean(area)))
        expected += weight * np.mean(errors)
    got = multiscale_l1([torch.from_numpy(p) for p in predictions], torch.from_numpy(truth), weights)
    assert got.item() == pytest.approx(expected)


def test_stage_table_is_the_published_one() -> None:
    by_scale = {64: "1 .5 0 0 0 0 0", 32: ".2 1 .5 0 0 0 0", 16: "0 .2 1 .5 0 0 0"}
    by_scale |= {8: "0 0 .2 1 .5 0 0", 4: "0 0 0 .2 1 .5 0", 2: "0 0 0 0 .2 1 1"}
    published = np.array([[float(w) for w in row.split()] for row in by_scale.values()])
    np.testing.assert_array_equal(np.array(STAGE_WEIGHTS), published.T)


def test_stages_follow_their_ends() -> None:
    ends = (10, 20, 20, 30, 40, 50)
    for step, stage in ((0, 0), (9, 0), (10, 1), (20, 3), (49, 5), (50, 6)):
        assert stage_weights(step, STAGE_WEIGHTS, ends) == STAGE_WEIGHTS[stage]
    assert stage_weights(7, (STATIC_WEIGHTS,), ()) == STATIC_WEIGHTS
    with pytest.raises(ValueError, match="6 ends"):
        stage_weights(0, STAGE_WEIGHTS, (1, 2))


def test_equation_9(rng: np.random.Generator) -> None:
    truth = truth_with_gaps(rng)
    prediction = rng.normal(8, 6, truth.shape)
    error = np.maximum(prediction, 0) - truth
    along_x = [abs(error[b, 0, y, x + 1] - error[b, 0, y, x]) for b, _, y, x in np.ndindex(2, 1, 8, 11)]
    along_y = [abs(error[b, 0, y + 1, x] - error[b, 0, y, x]) for b, _, y, x in np.ndindex(2, 1, 7, 12)]
    expected = np.nanmean(np.abs(error)) + 5 * (np.nanmean(along_x) + np.nanmean(along_y))
    got = gradient_aware_l1(torch.from_numpy(prediction), torch.from_numpy(truth), 5.0)
    assert got.item() == pytest.approx(expected)


def test_confidence_loss(rng: np.random.Generator) -> None:
    truth = truth_with_gaps(rng)
    disparity = np.nan_to_num(truth, nan=3.0) + rng.choice([0.0, 0.9, 1.0, 1.1, -2.0], truth.shape)
    logits = rng.normal(size=(2, 2, 8, 12))
    losses = []
    for b, _, y, x in np.ndindex(truth.shape):
        if not np.isnan(truth[b, 0, y, x]):
            label = int(abs(disparity[b, 0, y, x] - truth[b, 0, y, x]) <= 1.0)
            wrong, correct = logits[b, :, y, x]
            losses.append(math.log(math.exp(wrong) + math.exp(correct)) - (correct if label else wrong))
    arrays = (logits, disparity, truth)
    got = confidence_cross_entropy(*(torch.from_numpy(a) for a in arrays), correct_within_px=1.0)
    assert got.item() == pytest.approx(np.mean(losses))


def test_gradient_loss_masks_discontinuities(rng: np.random.Generator) -> None:
    gradient = rng.normal(0, 0.8, (2, 2, 8, 12))
    gradient[:, :, -1] = np.nan
    prediction = rng.normal(size=gradient.shape)
    losses = []
    for b, y, x in np.ndindex(2, 8, 12):
        if all(abs(g) <= 1 for g in gradient[b, :, y, x]):
            losses.append(np.abs(prediction[b, :, y, x] - gradient[b, :, y, x]).sum())
    assert 0 < len(losses) < 2 * 7 * 12
    got = masked_gradient_l1(torch.from_numpy(prediction), torch.from_numpy(gradient), 1.0)
    assert got.item() == pytest.approx(np.mean(losses))


def test_missing_truth_sends_no_gradient_back() -> None:
    """Neither NaN nor anything else reaches a prediction through a pixel without ground truth."""
    truth = torch.full((1, 1, 4, 4), torch.nan)
    truth[..., :2] = 3.0
    prediction = torch.full((1, 1, 4, 4), 5.0, requires_grad=True)
    (disparity_l1(prediction, truth) + gradient_aware_l1(prediction, truth, 5.0)).backward()
    assert prediction.grad is not None
    assert torch.isfinite(prediction.grad).all()
    assert (prediction.grad[..., 2:] == 0).all()
    assert (prediction.grad[..., :2] > 0).all()


def test_no_truth_at_all_is_a_loss_of_zero() -> None:
    truth = torch.full((1, 1, 4, 4), torch.nan)
    prediction = torch.ones(1, 1, 4, 4, requires_grad=True)
    loss = multiscale_l1([prediction], truth, (1.0,))
    loss.backward()
    assert loss.item() == 0
    assert prediction.grad is not None
    assert (prediction.grad == 0).all()

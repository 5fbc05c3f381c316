"""ConfNet and GradNet without a regressor: what they see, that they learn, and what they answer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from refine.metrics import optimal_auc, sparsification_curve
from stereoforge_kit.matching import SGBMParameters, fill_background, left_right_consistency, match_both
from tests.training.running import train_quietly
from tests.training.synthetic import NO_AUGMENTATION, random_layer, random_pair, render, write_dataset
from training.data.batch import StereoBatch
from training.errors import TrainingError
from training.networks import ConfNet, DispNetConfig, DispNetCorr1D, predict_right
from training.networks.lrc import left_right_consistency as lrc
from training.networks.regressor_free import (
    REGRESSOR_FREE_CHANNELS,
    disparity_features,
    match_batch,
    regressor_free_inputs,
)
from training.prediction.predictor import RegressorFreePredictor
from training.preset_kinds import RegressorFreeConfNetPreset, RegressorFreeGradNetPreset
from training.presets import find_preset
from training.runs.weights import TrainingSummary, load_confnet, read_summary, save_weights
from training.tasks.regressor_free import RegressorFreeConfNetTask

SUMMARY = TrainingSummary("tiny", 1, 0, (("set", 1.0),), best_step=1)
MATCHER = SGBMParameters(max_disparity_px=48)


def quick(task: str) -> RegressorFreeConfNetPreset | RegressorFreeGradNetPreset:
    preset = find_preset(task, "tiny")
    assert isinstance(preset, RegressorFreeConfNetPreset | RegressorFreeGradNetPreset)
    return replace(
        preset,
        crop_width=128,
        crop_height=64,
        batch_size=2,
        validation_interval=150,
        augmentation=NO_AUGMENTATION,
        matcher=MATCHER,
        # A reach of 30 pixels in every direction would see more border than picture in so small a crop.
        network=replace(preset.network, width=16, hidden=16, dropout=0.0, dilations=(1, 2, 4, 4)),
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder with both networks, trained without a regressor on four pairs."""
    data = write_dataset(tmp_path_factory.mktemp("set"), 0, train=4, val=2)
    folder = tmp_path_factory.mktemp("run")
    for task, steps in {"confnet_free": 150, "gradnet_free": 300}.items():
        train_quietly(task, [(data, 1.0)], folder, quick(task), steps=steps)
    return folder


def test_features_are_what_they_say() -> None:
    rng = np.random.default_rng(0)
    disparity = rng.uniform(0, 30, (12, 20)).astype(np.float32)
    disparity[3:5, 4:9] = np.nan
    right = np.roll(disparity, -2, axis=1)
    inputs = regressor_free_inputs(disparity, right)
    filled, consistency = fill_background(disparity), left_right_consistency(disparity, right)
    np.testing.assert_array_equal(inputs.disparity[0, 0], filled)
    np.testing.assert_array_equal(inputs.consistency[0, 0], consistency)
    features = disparity_features(*inputs)[0].numpy()
    assert features.shape == (REGRESSOR_FREE_CHANNELS, 12, 20)
    np.testing.assert_array_equal(features[0], filled)
    np.testing.assert_array_equal(features[1], np.isfinite(disparity))
    np.testing.assert_array_equal(features[2], (consistency >= 0) & (consistency <= 1))
    np.testing.assert_allclose(features[3][:, :-1], np.diff(filled, axis=1).clip(-4, 4), atol=1e-5)
    np.testing.assert_allclose(features[4][:-1], np.diff(filled, axis=0).clip(-4, 4), atol=1e-5)
    assert (features[3][:, -1] == 0).all()
    assert (features[4][-1] == 0).all()
    np.testing.assert_allclose(
        features[5][6, 7], np.clip(filled[6, 7] - filled[2:11, 3:12].mean(), -8, 8), atol=1e-4
    )


def test_nothing_known_is_still_finite() -> None:
    nothing = np.full((6, 8), np.nan, np.float32)
    inputs = regressor_free_inputs(nothing, nothing)
    assert torch.isfinite(inputs.features).all()
    assert not inputs.known.any()


def test_a_batch_is_matched_pair_by_pair() -> None:
    pairs = [random_pair(np.random.default_rng(seed), 48, 96) for seed in (0, 1)]
    images = [np.stack([getattr(pair, view) for pair in pairs]) for view in ("left", "right")]
    left, right = (torch.from_numpy(image).permute(0, 3, 1, 2).float() / 255 for image in images)
    matched = match_batch(left, right, MATCHER)
    for index, pair in enumerate(pairs):
        alone = regressor_free_inputs(*match_both(pair.left, pair.right, MATCHER))
        for got, expected in zip(matched, alone, strict=True):
            torch.testing.assert_close(got[index : index + 1], expected)


@pytest.mark.slow
def test_they_learn_what_matching_gets_wrong(run: Path) -> None:
    """On a pair they have not seen, the confidence sorts out most of the wrong pixels."""
    pair = random_pair(np.random.default_rng(50), 64, 128)
    left, right = match_both(pair.left, pair.right, MATCHER)
    answer = RegressorFreePredictor(run).predict(pair.left, pair.right, left, right)
    assert answer.confidence is not None
    np.testing.assert_array_equal(answer.disparity, fill_background(left))
    wrong = np.abs(answer.disparity - pair.disparity_left) > 1
    assert 0.02 < wrong.mean() < 0.6
    rate = float(wrong.mean())
    best = optimal_auc(rate)
    area = sparsification_curve(answer.disparity, pair.disparity_left, answer.confidence).auc
    assert area < best + 0.4 * (rate - best)


@pytest.mark.slow
def test_they_learn_slopes(run: Path) -> None:
    """Nearer to the true slopes than matching's own, and than no slope at all."""
    rng = np.random.default_rng(51)
    pair = render([random_layer(rng, 3.0, (0.0, 0.055))], 64, 128)
    left, right = match_both(pair.left, pair.right, MATCHER)
    answer = RegressorFreePredictor(run).predict(pair.left, pair.right, left, right)
    assert answer.gradient is not None
    truth = np.diff(pair.disparity_left, axis=0)
    guesses = {
        "network": answer.gradient[:-1, :, 1],
        "matching": np.diff(answer.disparity, axis=0),
        "level": np.zeros_like(truth),
    }
    errors = {name: np.abs(guess - truth).mean() for name, guess in guesses.items()}
    assert errors["network"] < 0.9 * min(errors["matching"], errors["level"])


@pytest.mark.slow
def test_networks_are_optional_and_checked(run: Path, tmp_path: Path) -> None:
    pair = random_pair(np.random.default_rng(1), 33, 47)
    disparity = pair.disparity_left
    answer = RegressorFreePredictor(run).predict(pair.left, pair.right, disparity, pair.disparity_right)
    assert answer.confidence is not None
    assert answer.confidence.shape == (33, 47)
    bare = RegressorFreePredictor(tmp_path).predict(pair.left, pair.right, disparity, pair.disparity_right)
    assert bare.confidence is None
    assert bare.gradient is None
    with pytest.raises(TrainingError, match="no such run folder"):
        RegressorFreePredictor(tmp_path / "nothing")
    with pytest.raises(TrainingError, match="right disparity is 47x20"):
        RegressorFreePredictor(run).predict(pair.left, pair.right, disparity, pair.disparity_right[:20])
    (tmp_path / "confnet_free.safetensors").write_bytes((run / "gradnet_free.safetensors").read_bytes())
    (tmp_path / "confnet_free.json").write_bytes((run / "gradnet_free.json").read_bytes())
    with pytest.raises(TrainingError, match="describes a gradnet_free"):
        load_confnet(tmp_path, "confnet_free")


def test_half_of_the_crops_carry_a_regressors_disparity() -> None:
    torch.manual_seed(0)
    regressor = DispNetCorr1D(DispNetConfig(width=0.0625))
    preset = quick("confnet_free")
    assert isinstance(preset, RegressorFreeConfNetPreset)
    task = RegressorFreeConfNetTask(preset, regressor, ConfNet(preset.network), 10, 0).train()
    assert not regressor.training
    left, right = torch.rand(2, 3, 3, 64, 128)
    truth = torch.zeros(3, 1, 64, 128)
    initial = task.initial_disparities(StereoBatch(left, right, truth, truth.repeat(1, 2, 1, 1)))
    matched = match_batch(left[:2], right[:2], MATCHER)
    for given, expected in zip(initial, matched, strict=True):
        torch.testing.assert_close(given[:2], expected)
    with torch.no_grad():
        predicted = regressor.regress(left[2:], right[2:]).disparity
        mirrored = predict_right(lambda a, b: regressor.regress(a, b).disparity, left[2:], right[2:])
    torch.testing.assert_close(initial.disparity[2:], predicted)
    assert (initial.known[2:] == 1).all()
    torch.testing.assert_close(initial.consistency[2:], lrc(predicted, mirrored))


def test_a_run_on_a_regressor_says_so_and_keeps_to_it(tmp_path: Path) -> None:
    data = write_dataset(tmp_path / "set", 0, train=2, val=1)
    for seed in (0, 1):
        torch.manual_seed(seed)
        save_weights(
            tmp_path / f"init{seed}", "regressor", DispNetCorr1D(DispNetConfig(width=0.0625)), SUMMARY
        )
    options = {"steps": 2, "init": tmp_path / "init0"}
    train_quietly("confnet_free", [(data, 1.0)], tmp_path / "run", quick("confnet_free"), **options)
    said = read_summary(tmp_path / "run", "confnet_free").preset
    assert said.endswith(f"half on the disparity of {tmp_path / 'init0'}")
    assert not (tmp_path / "run" / "regressor.safetensors").exists()
    options |= {"resume": True, "steps": 4, "init": tmp_path / "init1"}
    with pytest.raises(TrainingError, match="judged"):
        train_quietly("confnet_free", [(data, 1.0)], tmp_path / "run", quick("confnet_free"), **options)
    with pytest.raises(TrainingError, match="holds no trained regressor"):
        train_quietly(
            "gradnet_free", [(data, 1.0)], tmp_path / "run", quick("gradnet_free"), init=tmp_path / "none"
        )

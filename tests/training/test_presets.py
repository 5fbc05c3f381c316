"""The full presets are the published training; schedules follow their definition."""

import math
from dataclasses import fields, is_dataclass

import pytest
import torch

from training.data.batch import StereoBatch
from training.losses import STAGE_WEIGHTS
from training.networks import (
    ConfNet,
    DispNetConfig,
    DispNetCorr1D,
    GradNet,
    HeadConfig,
    left_right_consistency,
    predict_right,
)
from training.networks.regressors.dispnet import MultiscaleObjective
from training.networks.regressors.registry import known_regressors, regressor_for
from training.preset_kinds import (
    ConfNetPreset,
    FineTuningPreset,
    GradNetPreset,
    OptimizerConfig,
    Preset,
    RegressorPreset,
)
from training.presets import PRESETS, REGRESSOR_PRESETS, find_preset
from training.tasks import ConfNetTask, GradNetTask, RegressorTask
from training.tasks.base import learning_rate_factor


def test_full_regressor() -> None:
    preset = find_preset("regressor", "full", "dispnet")
    assert isinstance(preset, RegressorPreset)
    assert preset.network == DispNetConfig() == DispNetConfig(1.0, 40, False, "none", 1.0)
    assert (preset.batch_size, preset.crop_width, preset.crop_height) == (4, 768, 384)
    optimizer = preset.optimizer
    assert (optimizer.learning_rate, optimizer.betas, optimizer.epsilon) == (1e-4, (0.9, 0.999), 1e-4)
    assert optimizer.halve_at == (200_000, 350_000, 500_000, 650_000, 800_000)
    assert (optimizer.weight_decay, optimizer.clip_norm, optimizer.warmup_steps) == (4e-4, None, 0)
    assert isinstance(preset.objective, MultiscaleObjective)
    assert preset.objective.stages == STAGE_WEIGHTS
    assert [round(end * preset.steps) for end in preset.objective.stage_ends] == [
        100_000,
        200_000,
        300_000,
        400_000,
        500_000,
        600_000,
    ]
    augmentation = preset.augmentation
    assert (augmentation.translation, augmentation.log_zoom, augmentation.log_squeeze) == (
        0.4,
        (-0.2, 0.6),
        (-0.3, 0.3),
    )
    assert (augmentation.noise, augmentation.horizontal_flip, augmentation.vertical_flip) == (0.06, 0, 0)


def test_full_heads() -> None:
    confnet, gradnet = find_preset("confnet", "full"), find_preset("gradnet", "full")
    fine_tuning = find_preset("regressor_f", "full")
    assert isinstance(confnet, ConfNetPreset)
    assert isinstance(gradnet, GradNetPreset)
    assert isinstance(fine_tuning, FineTuningPreset)
    assert (confnet.steps, confnet.optimizer.learning_rate, confnet.optimizer.weight_decay) == (
        320_000,
        1e-3,
        5e-4,
    )
    assert confnet.optimizer.halve_at == tuple(range(40_000, 320_000, 40_000))
    assert (gradnet.steps, gradnet.optimizer.learning_rate, gradnet.optimizer.weight_decay) == (
        200_000,
        1e-4,
        4e-4,
    )
    assert gradnet.optimizer.halve_at == tuple(range(20_000, 200_000, 20_000))
    assert confnet.network == HeadConfig(97, 64, 128, 0.5, "none", False)
    assert confnet.network.features == "joined"
    assert {preset.curriculum for preset in (full_regressor(), fine_tuning, confnet, gradnet)} == {0.0}
    assert gradnet.network == HeadConfig(97, 64, 128, 0.2, "none", False)
    assert (confnet.correct_within_px, gradnet.gradient_threshold_px) == (1.0, 1.0)
    assert fine_tuning.gradient_weight == 5.0


def full_regressor() -> RegressorPreset:
    preset = find_preset("regressor", "full", "dispnet")
    assert isinstance(preset, RegressorPreset)
    return preset


def narrow_task() -> RegressorTask:
    """The full preset's task, as training builds it but for the network's width."""
    preset = full_regressor()
    return RegressorTask(preset, DispNetCorr1D(DispNetConfig(width=0.0625)), preset.steps, seed=0)


def test_the_full_optimizer_runs_the_published_schedule() -> None:
    """Read off the running optimizer and scheduler: Adam's constants, and the rate around every halving."""
    configured = narrow_task().configure_optimizers()
    optimizer, scheduler = configured["optimizer"], configured["lr_scheduler"]["scheduler"]
    assert isinstance(optimizer, torch.optim.Adam)
    assert configured["lr_scheduler"]["interval"] == "step"
    for group in optimizer.param_groups:
        assert (group["betas"], group["eps"], group["lr"]) == ((0.9, 0.999), 1e-4, 1e-4)
    rate = scheduler.lr_lambdas[0]
    halvings = (200_000, 350_000, 500_000, 650_000, 800_000)
    for number, step in enumerate(halvings):
        assert rate(step - 1) == 0.5**number
        assert rate(step) == 0.5 ** (number + 1)
    assert rate(1_199_999) == 0.5**5


@pytest.mark.parametrize("step", [0, 99_999, 100_000, 250_000, 399_999, 450_000, 550_000, 600_000, 1_199_999])
def test_the_full_loss_weighs_the_scales_of_the_step(step: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The loss of a batch is the table's row of that step times the error of each scale."""
    task = narrow_task()
    monkeypatch.setattr(type(task), "global_step", property(lambda _: step))
    torch.manual_seed(0)
    left, right = torch.rand(1, 3, 64, 64), torch.rand(1, 3, 64, 64)
    batch = StereoBatch(left, right, torch.full((1, 1, 64, 64), 7.0), torch.zeros(1, 2, 64, 64))
    with torch.no_grad():
        errors = [(torch.relu(d) - 7.0).abs().mean().item() for d in task.network(left, right).disparities]
        loss = task.loss(batch).item()
    row = STAGE_WEIGHTS[min(step // 100_000, 6)]
    assert loss == pytest.approx(sum(w * e for w, e in zip(row, errors, strict=True)), rel=1e-5)


def test_full_heads_see_the_features_and_the_mirrored_consistency() -> None:
    """ConfNet's input is the image (3), 97 features and the LRC map made of a mirrored prediction; GradNet's the
    image and the features."""
    torch.manual_seed(0)
    regressor = DispNetCorr1D()
    presets = {name: find_preset(name, "full") for name in ("confnet", "gradnet")}
    assert isinstance(presets["confnet"], ConfNetPreset)
    assert isinstance(presets["gradnet"], GradNetPreset)
    confnet = ConfNetTask(presets["confnet"], regressor, ConfNet(presets["confnet"].network), 1, 0)
    gradnet = GradNetTask(presets["gradnet"], regressor, GradNet(presets["gradnet"].network), 1, 0)
    left, right = torch.rand(2, 1, 3, 64, 128)
    batch = StereoBatch(left, right, torch.zeros(1, 1, 64, 128), torch.zeros(1, 2, 64, 128))
    (image, features, consistency), disparity = confnet.head_inputs(batch)
    assert (image.shape[1], features.shape[1], consistency.shape[1]) == (3, 97, 1)
    with torch.no_grad():
        mirrored = predict_right(lambda a, b: regressor.regress(a, b).disparity, left, right)
    torch.testing.assert_close(consistency, left_right_consistency(disparity, mirrored))
    assert confnet.network.joined_input(image, features, consistency).shape == (1, 101, 64, 128)
    inputs, _ = gradnet.head_inputs(batch)
    assert gradnet.network.joined_input(*inputs).shape == (1, 100, 64, 128)
    for task, epsilon in ((confnet, 1e-8), (gradnet, 1e-8)):
        groups = task.configure_optimizers()["optimizer"].param_groups
        assert {id(p) for p in groups[0]["params"]} == {id(p) for p in task.network.parameters()}
        assert groups[0]["weight_decay"] == task.preset.optimizer.weight_decay > 0
        assert groups[0]["eps"] == epsilon


EVERY_PRESET = [preset for presets in PRESETS.values() for preset in presets.values()]
EVERY_PRESET += [preset for presets in REGRESSOR_PRESETS.values() for preset in presets.values()]


def test_every_regressor_has_presets() -> None:
    assert REGRESSOR_PRESETS.keys() == known_regressors().keys()
    for network, presets in REGRESSOR_PRESETS.items():
        assert presets.keys() == {"tiny", "small", "full"}
        for preset in presets.values():
            assert isinstance(preset, RegressorPreset)
            assert regressor_for(preset.network).name == network


@pytest.mark.parametrize("preset", EVERY_PRESET)
def test_presets_are_coherent(preset: Preset) -> None:
    unit = regressor_for(preset.network).stride if isinstance(preset, RegressorPreset) else 64
    assert preset.crop_width % unit == preset.crop_height % unit == 0
    assert preset.optimizer.warmup_steps < preset.steps
    for field in fields(preset):
        value = getattr(preset, field.name)
        if is_dataclass(value):
            hash(value)
    if isinstance(preset, RegressorPreset):
        objective = preset.objective
        assert list(objective.stage_ends) == sorted(objective.stage_ends)
        assert all(0 < end < 1 for end in objective.stage_ends)
        if isinstance(objective, MultiscaleObjective):
            assert len(objective.stage_ends) == len(objective.stages) - 1


def test_decay_reaches_the_contracting_weights_only() -> None:
    preset = find_preset("regressor", "full", "dispnet")
    assert isinstance(preset, RegressorPreset)
    network = DispNetCorr1D(DispNetConfig(width=0.0625))
    task = RegressorTask(preset, network, preset.steps, seed=0)
    decayed, free = task.configure_optimizers()["optimizer"].param_groups
    assert (decayed["weight_decay"], free["weight_decay"]) == (4e-4, 0)
    assert {id(p) for p in decayed["params"]} == {id(p) for p in network.decayed_parameters()}
    trained = {id(p) for p in network.parameters() if p.requires_grad}
    assert {id(p) for group in (decayed, free) for p in group["params"]} == trained


def test_halving() -> None:
    config = OptimizerConfig(halve_at=(100, 300))
    factors = [learning_rate_factor(config, step, 400, 400) for step in (0, 99, 100, 299, 300, 399)]
    assert factors == [1, 1, 0.5, 0.5, 0.25, 0.25]
    assert [learning_rate_factor(config, step, 40, 400) for step in (9, 10, 29, 30)] == [1, 0.5, 0.5, 0.25]


def test_warmup_and_cosine() -> None:
    config = OptimizerConfig(schedule="cosine", warmup_steps=10)
    factors = [learning_rate_factor(config, step, 100, 100) for step in range(100)]
    assert factors[0] == pytest.approx(1 / 11)
    assert factors[:11] == sorted(factors[:11])
    assert factors[50] == pytest.approx(0.5)
    assert factors[99] == pytest.approx(0.5 * (1 + math.cos(math.pi * 0.99)))
    assert learning_rate_factor(config, 500, 1000, 100) == pytest.approx(0.5)

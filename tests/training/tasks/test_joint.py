"""ConfNet and GradNet trained through the refinement."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import pytorch_lightning as pl
import safetensors.torch
import torch
from torch import Tensor

from datagen import StereoDataset
from refine import MRFParameters
from refine.energy.confidence_shape import ConfidenceShape
from refine.methods.ours import Ours
from stereoforge.cli import main
from tests.training.running import train_quietly
from tests.training.synthetic import NO_AUGMENTATION, write_dataset
from training.errors import TrainingError
from training.networks import ConfNet, DispNetConfig, DispNetCorr1D, GradNet, HeadConfig
from training.networks.inference import HeadInputs, Regression
from training.prediction.predictor import StereoPredictor
from training.preset_kinds import JointPreset, Preset, RegressorPreset
from training.presets import find_preset
from training.runs.weights import read_summary
from training.tasks import JointHeads, JointTask, StereoTask

HEIGHT, WIDTH = 32, 40
HEAD = HeadConfig(feature_channels=4, width=8, hidden=8, dropout=0.0)


class GivenBatch(NamedTuple):
    """As much of a `StereoBatch` as the task reads, and what the regressor is taken to answer."""

    left: Tensor
    disparity: Tensor
    gradient: Tensor
    initial: Tensor
    features: Tensor
    consistency: Tensor


class GivenTask(JointTask):
    """A joint task about given disparities and features, whatever the regressor says."""

    def __init__(self, preset: JointPreset, refinement: Ours) -> None:
        torch.manual_seed(0)
        heads = JointHeads(ConfNet(HEAD), GradNet(HEAD))
        super().__init__(preset, DispNetCorr1D(DispNetConfig(width=0.0625)), heads, refinement, 1, 0)

    def inputs(self, batch: GivenBatch) -> HeadInputs:  # type: ignore[override]
        seen = batch.left, batch.features
        regression = Regression(batch.initial, {"joined": batch.features})
        return HeadInputs(regression, (*seen, batch.consistency), seen)


def given_batch(samples: int = 2) -> GivenBatch:
    """Planes with a wrong box each, which one of the features gives away; flat colours, so that slopes carry far."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    truth = np.stack([10 + 0.1 * x + 0.05 * (n + 1) * y for n in range(samples)])[:, None]
    wrong = np.zeros_like(truth)
    for n in range(samples):
        wrong[n, 0, 10 + 3 * n : 22, 8 : 24 - 4 * n] = 1
    slopes = np.stack([[np.full_like(x, 0.1), np.full_like(x, 0.05 * (n + 1))] for n in range(samples)])
    features = rng.normal(0, 1, (samples, 4, HEIGHT, WIDTH))
    features[:, :1] += 3 * wrong
    arrays = {
        "left": np.full((samples, 3, HEIGHT, WIDTH), 0.4) + rng.normal(0, 0.002, (samples, 3, HEIGHT, WIDTH)),
        "disparity": truth,
        "gradient": slopes,
        "initial": truth + 6 * wrong + rng.normal(0, 0.1, truth.shape),
        "features": features,
        "consistency": np.zeros_like(truth),
    }
    return GivenBatch(
        **{name: torch.from_numpy(values.astype(np.float32)) for name, values in arrays.items()}
    )


def joint(**changes: object) -> JointPreset:
    preset = find_preset("joint", "tiny")
    assert isinstance(preset, JointPreset)
    return replace(preset, **changes)  # type: ignore[arg-type]


def refined(task: JointTask, batch: GivenBatch) -> Tensor:
    (disparity, *_), confnet_sees, gradnet_sees = task.inputs(batch)
    logits, gradient = task.network.confnet(*confnet_sees), task.network.gradnet(*gradnet_sees)
    return task.refine(batch.left, disparity, logits, gradient)


@pytest.mark.parametrize("form", ["exact", "paper"])
def test_refines_as_the_method_does(form: str) -> None:
    """What is trained through is `Ours` with its parameters and its shape of the confidence."""
    ours = Ours(MRFParameters(30.0, 1.0, 4.0), ConfidenceShape(0.7, 2.0), form=form)  # type: ignore[arg-type]
    task, batch = GivenTask(joint(tolerance=1e-7), ours), given_batch(1)
    batch = batch._replace(left=(batch.left * 255).round() / 255)
    (disparity, *_), confnet_sees, gradnet_sees = task.inputs(batch)
    with torch.no_grad():
        got = refined(task, batch)[0, 0]
        confidence = task.network.confnet.confidence(*confnet_sees)[0, 0].numpy()
        gradient = task.network.gradnet(*gradnet_sees)[0].permute(1, 2, 0).numpy()
    image = (batch.left[0] * 255).round().byte().permute(1, 2, 0).numpy()
    expected = ours.solve(disparity[0, 0].numpy(), confidence, gradient, image).disparity
    np.testing.assert_allclose(got, expected, atol=2e-3)


def test_slopes_reach_every_weight_of_both_heads_and_none_of_the_regressor() -> None:
    task, batch = GivenTask(joint(), Ours()), given_batch()
    (refined(task, batch) - batch.disparity).abs().mean().backward()
    for head in (task.network.confnet, task.network.gradnet):
        for name, parameter in head.named_parameters():
            assert parameter.grad is not None, name
            assert parameter.grad.abs().max() > 0, name
    assert all(parameter.grad is None for parameter in task.regressor.parameters())


def test_pixels_without_truth_neither_count_nor_poison() -> None:
    task, batch = GivenTask(joint(), Ours()), given_batch()
    losses, slopes = [], []
    for missing in (False, True):
        if missing:
            batch.disparity[1] = torch.nan
            batch.gradient[1] = torch.nan
        task.network.zero_grad()
        loss = task.loss(batch if missing else GivenBatch(*(tensor[:1] for tensor in batch)))
        loss.backward()
        losses.append(loss.item())
        slopes.append(torch.cat([p.grad.flatten() for p in task.network.parameters() if p.grad is not None]))
    assert losses[0] == pytest.approx(losses[1], rel=1e-3)
    torch.testing.assert_close(*slopes, rtol=1e-2, atol=1e-3)
    batch.disparity[:], batch.gradient[:] = torch.nan, torch.nan
    task.network.zero_grad()
    task.loss(batch).backward()
    assert all(p.grad is not None and p.grad.isfinite().all() for p in task.network.parameters())


def test_overfits_two_samples() -> None:
    """The refined disparity's error falls to a tenth of the initial one's, and the loss with it."""
    task, batch = GivenTask(joint(), Ours()), given_batch()
    optimizer = torch.optim.Adam(task.network.parameters(), 3e-3)
    losses = []
    for _ in range(60):
        loss = task.loss(batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    error, before = (
        (disparity - batch.disparity).abs().mean() for disparity in (refined(task, batch), batch.initial)
    )
    assert error < 0.3 * before
    assert losses[-1] < 0.3 * losses[0]


# Whole runs


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("set"), 0, train=3, val=1)


def quick(task: str) -> Preset:
    preset = replace(
        find_preset(task, "tiny", "dispnet"),
        crop_width=128,
        crop_height=64,
        batch_size=2,
        validation_interval=3,
    )
    if isinstance(preset, RegressorPreset):
        return replace(
            preset, network=DispNetConfig(width=0.0625, normalization="batch", prediction_scale=16.0)
        )
    return replace(preset, augmentation=NO_AUGMENTATION)


@pytest.fixture(scope="module")
def start(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder with three networks of a few steps."""
    folder = tmp_path_factory.mktemp("start")
    for task in ("regressor", "confnet", "gradnet"):
        train_quietly(task, [(data, 1.0)], folder, quick(task), steps=3)
    return folder


def weights(run: Path, task: str) -> dict[str, Tensor]:
    return safetensors.torch.load_file(run / f"{task}.safetensors")


class _PowerCut(Exception):  # noqa: N818
    pass


def test_resumed_equals_uninterrupted(data: Path, start: Path, tmp_path: Path) -> None:
    """The same weights of both heads, bit for bit; other than those they started from, the regressor unchanged."""
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    options = {"init": start, "steps": 8, "seed": 3}
    train_quietly("joint", [(data, 1.0)], whole, quick("joint"), **options)  # type: ignore[arg-type]

    def stop(self: pl.LightningModule, *_: object) -> None:
        if self.global_step == 5:
            raise _PowerCut

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(StereoTask, "on_train_batch_end", stop)
        with pytest.raises(_PowerCut):
            train_quietly("joint", [(data, 1.0)], broken, quick("joint"), **options)  # type: ignore[arg-type]
    train_quietly("joint", [(data, 1.0)], broken, quick("joint"), resume=True, **options)  # type: ignore[arg-type]

    last = [
        torch.load(run / "logs/joint/last.ckpt", weights_only=True)["state_dict"] for run in (whole, broken)
    ]
    assert all(torch.equal(tensor, last[1][name]) for name, tensor in last[0].items())
    for task in ("confnet", "gradnet"):
        expected, got, before = weights(whole, task), weights(broken, task), weights(start, task)
        assert all(torch.equal(expected[name], got[name]) for name in expected)
        assert not all(torch.equal(expected[name], before[name]) for name in expected)
        texts = [json.loads((run / f"{task}.json").read_text()) for run in (whole, broken)]
        assert texts[0] == texts[1]
    assert all(torch.equal(t, weights(start, "regressor")[n]) for n, t in weights(whole, "regressor").items())
    assert set(read_summary(whole, "gradnet").validation) == {
        *("refined_epe", "refined_bad1", "refined_gradient", "gradient", "auc")
    }
    sample = StereoDataset(data, "val")[0]
    prediction = StereoPredictor(whole).predict(sample.left, sample.right)
    assert prediction.confidence is not None
    assert prediction.gradient is not None
    options |= {"resume": True, "refinement": Ours(MRFParameters(alpha=7.0))}
    with pytest.raises(TrainingError, match="another refinement"):
        train_quietly("joint", [(data, 1.0)], whole, quick("joint"), **options)  # type: ignore[arg-type]


def test_the_command_trains_through_validated_parameters_and_hands_them_on(
    data: Path, start: Path, tmp_path: Path
) -> None:
    init, out = shutil.copytree(start, tmp_path / "init"), tmp_path / "out"
    ours = {"parameters": {"alpha": 12.5}, "shape": {"power": 2.0}}
    document = {
        "format": 1,
        "about": {},
        "methods": {"ours_quadratic": ours, "ours": {**ours, "gradient_scale": 0.1}},
        "trials": {},
    }
    (init / "parameters.json").write_text(json.dumps(document))
    words = f"train joint --data {data} --init {init} --out {out} --preset tiny --crop 128x64 --steps 1"
    with pytest.raises(SystemExit) as end:
        main(words.split())
    assert end.value.code == 0
    assert (out / "parameters.json").read_text() == (init / "parameters.json").read_text()
    noted = json.loads((out / "logs/joint/settings.json").read_text())["refinement"]
    assert noted["parameters"]["alpha"] == 12.5
    assert noted["shape"]["power"] == 2.0


def test_wrong_requests_are_sentences(data: Path, start: Path, tmp_path: Path) -> None:
    source = [(data, 1.0)]
    with pytest.raises(TrainingError, match="not with a robust one"):
        train_quietly(
            "joint", source, tmp_path / "r", quick("joint"), init=start, refinement=Ours(gradient_scale=0.1)
        )
    with pytest.raises(TrainingError, match="another run folder"):
        train_quietly("joint", source, start, quick("joint"), init=start)
    with pytest.raises(TrainingError, match="already holds a confnet"):
        train_quietly("joint", source, shutil.copytree(start, tmp_path / "copy"), quick("joint"), init=start)
    with pytest.raises(TrainingError, match="name it as init"):
        train_quietly("joint", source, tmp_path / "none", quick("joint"))
    with pytest.raises(TrainingError, match="only joint trains through a refinement"):
        train_quietly("confnet", source, tmp_path / "conf", quick("confnet"), init=start, refinement=Ours())
    bare = tmp_path / "bare"
    bare.mkdir()
    for file in start.glob("regressor.*"):
        shutil.copy(file, bare)
    with pytest.raises(TrainingError, match="no trained confnet"):
        train_quietly("joint", source, tmp_path / "out", quick("joint"), init=bare)

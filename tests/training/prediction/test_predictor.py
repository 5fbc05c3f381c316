"""Weights on disk and the predictor that reads them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import safetensors.torch
import torch
from torch import Tensor, nn

from training.devices import computes_in_bfloat16
from training.errors import TrainingError
from training.networks import (
    ConfNet,
    CostVolumeConfig,
    DispNetConfig,
    DispNetCorr1D,
    GradNet,
    HeadConfig,
    Regressor,
)
from training.networks.cost_features import CostFeatures
from training.networks.inference import estimate
from training.networks.regressors.interface import Fitting, Regression, RegressorConfig, Resizing
from training.networks.regressors.registry import regressor_for
from training.prediction.predictor import StereoPredictor
from training.runs.weights import TrainingSummary, load_gradnet, load_regressor, read_summary, save_weights

SUMMARY = TrainingSummary(
    "custom", 10, 0, (("data", 1.0),), best_step=5, validation={"epe": 1.5},
    fingerprints=("4 frames, recipe abc",), revision="0.1.0 (cafe)",
)  # fmt: skip
CONFIG = DispNetConfig(width=0.0625, normalization="batch")
NARROW: dict[str, RegressorConfig] = {
    "dispnet": CONFIG,
    "costvolume": CostVolumeConfig(
        stem=4, encoder=(8, 8, 8, 8), aggregation=(4, 4, 4, 4), look_channels=8, full_channels=4
    ),
}


def save_run(run: Path, network: str = "dispnet") -> tuple[Regressor, ConfNet, GradNet]:
    torch.manual_seed(0)
    regressor = regressor_for(NARROW[network])(NARROW[network])
    regressor(torch.rand(2, 3, 64, 64), torch.rand(2, 3, 64, 64))  # moves BatchNorm's statistics
    save_weights(run, "regressor", regressor, SUMMARY)
    head = HeadConfig(width=4, hidden=4).on(regressor)
    confnet, gradnet = ConfNet(replace(head, cost_features=True)), GradNet(head)
    confnet.standardize(torch.rand(len(confnet.input_mean)), torch.rand(len(confnet.input_mean)) + 0.5)
    digest = load_regressor(run).sha256
    save_weights(run, "confnet", confnet, SUMMARY, digest)
    save_weights(run, "gradnet", gradnet, SUMMARY, digest)
    return regressor.eval(), confnet.eval(), gradnet.eval()


@pytest.fixture
def images() -> tuple[np.ndarray, np.ndarray]:
    left, right = np.random.default_rng(0).integers(0, 256, (2, 100, 150, 3), np.uint8)
    return left, right


@pytest.mark.parametrize("network", NARROW)
def test_what_was_saved_predicts_the_same(
    network: str, tmp_path: Path, images: tuple[np.ndarray, np.ndarray]
) -> None:
    networks = save_run(tmp_path, network)
    tensors = (torch.from_numpy(image).permute(2, 0, 1)[None].float() / 255 for image in images)
    expected = estimate(*networks, *tensors)
    got = StereoPredictor(tmp_path).predict(*images)
    assert expected.confidence is not None
    assert expected.gradient is not None
    assert got.confidence is not None
    assert got.gradient is not None
    # Up to rounding: for prediction, BatchNorm goes into the convolutions.
    np.testing.assert_allclose(got.disparity, expected.disparity[0, 0], atol=1e-3)
    np.testing.assert_allclose(got.confidence, expected.confidence[0, 0], atol=1e-4)
    np.testing.assert_allclose(got.gradient, expected.gradient[0].permute(1, 2, 0), atol=1e-4)
    assert got.disparity.shape == (100, 150)
    assert got.gradient.shape == (100, 150, 2)
    assert read_summary(tmp_path, "regressor") == SUMMARY


@pytest.mark.parametrize("network", NARROW)
def test_bfloat16_moves_the_answer_a_little(
    network: str, tmp_path: Path, images: tuple[np.ndarray, np.ndarray]
) -> None:
    save_run(tmp_path, network)
    exact = StereoPredictor(tmp_path).predict(*images)
    got = StereoPredictor(tmp_path, precision="bf16").predict(*images)
    for name in ("disparity", "confidence", "gradient"):
        maps, expected = getattr(got, name), getattr(exact, name)
        assert maps.dtype == np.float32
        assert 0 < np.abs(maps - expected).mean() < 0.02 * max(np.abs(expected).max(), 1)


def test_bfloat16_is_chosen_where_processors_multiply_it(monkeypatch: pytest.MonkeyPatch) -> None:
    for able, expected in (
        ({"avx512_bf16": True}, True),
        ({"amx_bf16": True}, True),
        ({"avx2": True}, False),
    ):
        monkeypatch.setattr(torch.cpu, "get_capabilities", lambda able=able: able)
        assert computes_in_bfloat16("auto", torch.device("cpu")) == expected
        assert not computes_in_bfloat16("auto", torch.device("cuda"))


def test_the_right_view_is_the_left_of_the_mirrored_pair(
    tmp_path: Path, images: tuple[np.ndarray, np.ndarray]
) -> None:
    save_run(tmp_path)
    predictor = StereoPredictor(tmp_path)
    left, right = images
    mirrored = predictor.predict(right[:, ::-1], left[:, ::-1]).disparity[:, ::-1]
    np.testing.assert_allclose(predictor.predict_right(left, right), mirrored, atol=1e-4)
    with pytest.raises(TrainingError, match="differ in size"):
        predictor.predict_right(left, right[:50])


def test_heads_are_optional(tmp_path: Path, images: tuple[np.ndarray, np.ndarray]) -> None:
    save_run(tmp_path)
    (tmp_path / "confnet.safetensors").unlink()
    got = StereoPredictor(tmp_path).predict(*images)
    assert got.confidence is None
    assert got.gradient is not None


class PlaneOracle(nn.Module):
    """Stands for a regressor: answers with the disparity of a plane, in pixels of the input it gets.

    A stretch by (sx, sy) turns d(x, y) = a + b x + c y into sx (a + b x / sx + c y / sy).
    """

    def __init__(self, height: int, width: int, plane: tuple[float, float, float]) -> None:
        super().__init__()
        self.size, self.plane = (height, width), plane
        self.seen: list[tuple[int, ...]] = []

    def stretch(self, view: Tensor) -> tuple[float, float]:
        return view.shape[-1] / self.size[1], view.shape[-2] / self.size[0]

    def fitting(self, height: int, width: int) -> Fitting:
        return Resizing(height, width, 64)

    def enlarged_size(self, height: int, width: int) -> None:
        del height, width

    def regress(self, left: Tensor, right: Tensor, stretch: float) -> Regression:
        assert stretch == pytest.approx(self.stretch(left)[0])
        features = torch.zeros(1, 1, 2, 2)
        return Regression(self(left, right), {"joined": features, "decoded": features})

    def forward(self, left: Tensor, right: Tensor) -> Tensor:  # noqa: ARG002
        self.seen.append(tuple(left.shape))
        stretch_x, stretch_y = self.stretch(left)
        a, b, c = self.plane
        x = (torch.arange(left.shape[-1]) + 0.5) / stretch_x
        y = (torch.arange(left.shape[-2])[:, None] + 0.5) / stretch_y
        return (stretch_x * (a + b * x + c * y))[None, None]


class SlopeOracle(PlaneOracle):
    """Stands for a GradNet: the slopes of that plane in pixels of the input it gets."""

    config = HeadConfig()

    def inputs(self, features: Tensor, cost_features: CostFeatures) -> tuple[Tensor, ...]:
        assert cost_features.right.shape == cost_features.left.shape
        assert cost_features.disparity.shape == (1, 1, *cost_features.left.shape[-2:])
        return cost_features.left, features

    def forward(self, left: Tensor, features: Tensor) -> Tensor:  # noqa: ARG002
        stretch_x, stretch_y = self.stretch(left)
        _, b, c = self.plane
        slopes = left.new_tensor([b, c * stretch_x / stretch_y]).view(1, 2, 1, 1)
        return slopes.expand(1, 2, *left.shape[-2:])


def test_images_are_resized_and_answers_keep_their_units() -> None:
    """Resized to the next multiples of 64, not padded; disparity and both slopes come back in the input's pixels."""
    height, width, plane = 100, 150, (20.0, 0.05, 0.1)
    regressor, gradnet = PlaneOracle(height, width, plane), SlopeOracle(height, width, plane)
    view = torch.rand(1, 3, height, width)
    answer = estimate(regressor, None, gradnet, view, view)  # type: ignore[arg-type]
    assert regressor.seen == [(1, 3, 128, 192)]
    x, y = np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5
    inner = (slice(2, -2), slice(2, -2))
    # The shrinking filter's discrete weights ripple by a few thousandths of a pixel on a slope.
    np.testing.assert_allclose(
        answer.disparity[0, 0].numpy()[inner], (20 + 0.05 * x + 0.1 * y)[inner], atol=0.01
    )
    assert answer.gradient is not None
    np.testing.assert_allclose(answer.gradient[0, 0], 0.05, rtol=1e-5)
    np.testing.assert_allclose(answer.gradient[0, 1], 0.1, rtol=1e-5)


def test_multiples_of_64_are_left_alone() -> None:
    view = torch.rand(1, 3, 64, 128)
    regressor = PlaneOracle(64, 128, (5.0, 0.0, 0.0))
    estimate(regressor, None, None, view, view)  # type: ignore[arg-type]
    assert regressor.seen == [(1, 3, 64, 128)]


@pytest.mark.parametrize("damage", ["flip", "truncate", "empty"])
def test_damaged_weights_are_refused(tmp_path: Path, damage: str) -> None:
    save_run(tmp_path)
    path = tmp_path / "regressor.safetensors"
    content = bytearray(path.read_bytes())
    if damage == "flip":
        content[len(content) // 2] ^= 1
    else:
        content = content[: len(content) // 2] if damage == "truncate" else bytearray()
    path.write_bytes(content)
    with pytest.raises(TrainingError, match=r"regressor\.safetensors: damaged"):
        StereoPredictor(tmp_path)


def edit_description(run: Path, task: str, **changes: object) -> None:
    path = run / f"{task}.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_weights_that_do_not_fit_their_description_are_refused(tmp_path: Path) -> None:
    save_run(tmp_path)
    for network, reason in (
        ({"name": "dispnet", "width": 0.125, "normalization": "batch"}, "size mismatch"),
        ({"name": "dispnet", "width": "wide"}, "could not convert|invalid value"),
        ({"name": "dispnet", "depth": 3}, "extra fields|depth"),
        ({"name": "dispnet", "normalization": "group"}, "normalization"),
        ({"name": "psmnet"}, "there is no network 'psmnet'; there are costvolume, dispnet"),
    ):
        edit_description(tmp_path, "regressor", network=network)
        with pytest.raises(TrainingError, match=reason):
            StereoPredictor(tmp_path)


def test_missing_files_and_wrong_tasks_are_sentences(tmp_path: Path) -> None:
    with pytest.raises(TrainingError, match="no such run folder"):
        StereoPredictor(tmp_path / "nothing")
    with pytest.raises(TrainingError, match=r"regressor\.safetensors: missing"):
        StereoPredictor(tmp_path)
    save_run(tmp_path)
    (tmp_path / "gradnet.json").write_text((tmp_path / "confnet.json").read_text())
    with pytest.raises(TrainingError, match=r"gradnet\.json: describes a confnet, not a gradnet"):
        load_gradnet(tmp_path)
    (tmp_path / "gradnet.json").write_text("{")
    with pytest.raises(TrainingError, match=r"gradnet\.json: cannot be read as JSON"):
        load_gradnet(tmp_path)
    (tmp_path / "gradnet.json").write_text("[]")
    with pytest.raises(TrainingError, match=r"gradnet\.json: does not describe a trained network"):
        load_gradnet(tmp_path)
    (tmp_path / "gradnet.json").unlink()
    with pytest.raises(TrainingError, match=r"gradnet\.json: missing"):
        load_gradnet(tmp_path)


def test_a_head_of_another_regressor_is_refused(tmp_path: Path) -> None:
    save_run(tmp_path)
    save_weights(tmp_path, "regressor", DispNetCorr1D(CONFIG), SUMMARY)
    with pytest.raises(TrainingError, match="confnet was trained on another regressor"):
        StereoPredictor(tmp_path)


def test_no_code_runs_when_weights_are_read(tmp_path: Path) -> None:
    """A pickle with the name of a weights file and a description that vouches for it is not executed."""
    import hashlib
    import pickle

    save_run(tmp_path)
    bomb = pickle.dumps(_Bomb(str(tmp_path / "exploded")))
    (tmp_path / "regressor.safetensors").write_bytes(bomb)
    edit_description(tmp_path, "regressor", sha256=hashlib.sha256(bomb).hexdigest())
    with pytest.raises(TrainingError, match="does not hold the regressor"):
        StereoPredictor(tmp_path)
    assert not (tmp_path / "exploded").exists()


class _Bomb:
    def __init__(self, path: str) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, (self.path, "w")


def test_images_of_the_wrong_kind_are_refused(tmp_path: Path, images: tuple[np.ndarray, np.ndarray]) -> None:
    save_run(tmp_path)
    predictor = StereoPredictor(tmp_path)
    left, right = images
    with pytest.raises(TrainingError, match="left 150x100, right 140x100"):
        predictor.predict(left, right[:, :140])
    with pytest.raises(
        TrainingError, match=r"right image must be \(H, W, 3\) of uint8, got \(100, 150, 3\) of float32"
    ):
        predictor.predict(left, right.astype(np.float32))


def test_stored_tensors_are_the_state(tmp_path: Path) -> None:
    regressor, _, _ = save_run(tmp_path)
    stored = safetensors.torch.load_file(tmp_path / "regressor.safetensors")
    assert stored.keys() == regressor.state_dict().keys()
    for name, tensor in regressor.state_dict().items():
        torch.testing.assert_close(stored[name], tensor, rtol=0, atol=0)

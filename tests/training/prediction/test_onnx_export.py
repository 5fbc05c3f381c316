"""Weights in other hands: ONNX against torch, and the card beside them."""

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
import torch.nn.functional as F  # noqa: N812

from stereoforge.bundled_weights import BUNDLED_WEIGHTS, PAPER_WEIGHTS
from tests.training.prediction.test_predictor import edit_description, save_run
from training.errors import TrainingError
from training.networks import ConfNet, Correlation1D
from training.networks.correlation import ShiftedCorrelation1D
from training.prediction.onnx_export import export_model
from training.prediction.predictor import StereoPredictor
from training.runs.model_card import write_model_card


@pytest.mark.parametrize("one_sided", [False, True])
def test_the_exported_correlation_is_the_same_function(one_sided: bool) -> None:
    correlation = Correlation1D(5, one_sided)
    left, right = torch.randn(2, 1, 4, 3, 17)
    torch.testing.assert_close(ShiftedCorrelation1D(correlation)(left, right), correlation(left, right))


@pytest.mark.parametrize(("network", "heads"), [("dispnet", True), ("dispnet", False), ("costvolume", True)])
def test_onnx_says_what_the_predictor_says(network: str, heads: bool, tmp_path: Path) -> None:
    """At sizes that the graph was not traced with."""
    save_run(tmp_path, network)
    if not heads:
        for name in ("confnet", "gradnet"):
            (tmp_path / f"{name}.safetensors").unlink()
    exported = export_model(tmp_path, tmp_path / "onnx")
    assert exported.outputs == (("disparity", "confidence", "gradient") if heads else ("disparity",))
    assert exported.largest_difference < 1e-4
    assert [path.name for path in (tmp_path / "onnx").iterdir()] == ["stereoforge.onnx"]
    left, right = np.random.default_rng(0).integers(0, 256, (2, 192, 256, 3), np.uint8)
    session = onnxruntime.InferenceSession(str(exported.path), providers=["CPUExecutionProvider"])
    answers = session.run(
        None,
        {
            n: i.transpose(2, 0, 1)[None].astype(np.float32) / 255
            for n, i in (("left", left), ("right", right))
        },
    )
    reach = 192 if network == "costvolume" else None  # the range of the exported model, whatever the size
    predictor = StereoPredictor(tmp_path, max_disparity=reach)
    predictor.networks[0].enlarged_to_pixels = None  # the model takes pictures as they are
    expected = predictor.predict(left, right)
    np.testing.assert_allclose(answers[0][0, 0], expected.disparity, atol=1e-3)
    if heads:
        assert expected.gradient is not None
        np.testing.assert_allclose(answers[1][0, 0], expected.confidence, atol=1e-3)
        np.testing.assert_allclose(answers[2][0].transpose(1, 2, 0), expected.gradient, atol=1e-3)


@pytest.mark.parametrize(
    "weights",
    [BUNDLED_WEIGHTS, PAPER_WEIGHTS],
)
def test_the_shipped_networks_can_be_exported(weights: Path, tmp_path: Path) -> None:
    """Their heads see more than the regressor's features."""
    assert export_model(weights, tmp_path).outputs == ("disparity", "confidence", "gradient")


def test_what_onnx_cannot_express_is_a_sentence_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_run(tmp_path)

    def halved(_: ConfNet, image: torch.Tensor, *__: torch.Tensor) -> torch.Tensor:
        return F.interpolate(image, size=[side // 2 for side in image.shape[-2:]], mode="area")

    monkeypatch.setattr(ConfNet, "confidence", halved)
    with pytest.raises(TrainingError, match="cannot write it as ONNX") as refusal:
        export_model(tmp_path, tmp_path / "onnx")
    assert len(str(refusal.value)) < 400
    assert not (tmp_path / "onnx").exists()


def test_a_head_of_another_regressor_is_not_exported(tmp_path: Path) -> None:
    save_run(tmp_path)
    edit_description(tmp_path, "confnet", regressor_sha256="0" * 64)
    with pytest.raises(TrainingError, match="confnet was trained on another regressor"):
        export_model(tmp_path, tmp_path / "onnx")
    assert not (tmp_path / "onnx").exists()


def test_model_card_tells_of_every_network(tmp_path: Path) -> None:
    save_run(tmp_path)
    text = write_model_card(tmp_path).read_text()
    for part in ("regressor.safetensors", "confnet.safetensors", "gradnet.safetensors"):
        assert f"## {part}" in text
    assert "| steps | 5 of 10 (the best by validation) |" in text
    assert "| data, weight 1 | data: 4 frames, recipe abc |" in text
    assert "| validation: end-point error, px | 1.5 |" in text
    assert "| code | 0.1.0 (cafe) |" in text

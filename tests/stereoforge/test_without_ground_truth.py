"""Sets whose files hold not one pixel of ground truth end every command that needs it, in one sentence."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from datagen import DatasetError
from datagen.formats import write_pfm, write_png
from datagen.formats.impossible_disparity import ImpossibleShare
from datagen.sources.ground_truth import mean_share, require_ground_truth
from datagen.sources.registry import open_source
from stereoforge.cli import main
from stereoforge.pipelines.forest import PLANS, train_forest
from stereoforge.pipelines.parameter_search import validation_frames
from stereoforge.pipelines.prediction import Predictors
from stereoforge.pipelines.set_evaluation import evaluate_set, open_test_data
from training.prediction.predictor import Prediction

SIZE = (64, 128)


def scenes(root: Path, *truths: float) -> Path:
    """A set in Middlebury's layout with a scene for each constant disparity."""
    for number, truth in enumerate(truths):
        folder = root / f"scene{number}"
        folder.mkdir(parents=True)
        for name in ("im0.png", "im1.png"):
            write_png(folder / name, np.full((*SIZE, 3), 100 + number, np.uint8))
        write_pfm(folder / "disp0.pfm", np.full(SIZE, truth, np.float32))
    return root


def test_the_first_files_are_named(tmp_path: Path) -> None:
    root = scenes(tmp_path / "set", np.inf, np.inf, np.nan, np.inf)
    with pytest.raises(DatasetError) as refusal:
        open_test_data([str(root)], "test")
    assert str(refusal.value) == (
        f"{root}: no pixel of its 4 frames has ground truth "
        "(scene0/disp0.pfm, scene1/disp0.pfm, scene2/disp0.pfm, ...)"
    )


def test_sentinels_and_signs_are_said(tmp_path: Path) -> None:
    root = scenes(tmp_path / "set", 1e30)
    with pytest.raises(
        DatasetError, match=r"100\.00% of the disparities cannot be .* larger than the picture"
    ):
        require_ground_truth(str(root), open_source(root).frames("test"))
    root = scenes(tmp_path / "other", -5.0)
    with pytest.raises(DatasetError, match=r"is the sign the other way round\?"):
        require_ground_truth(str(root), open_source(root).frames("test"))


def test_single_frames_without_any_are_fine(tmp_path: Path) -> None:
    root = scenes(tmp_path / "set", np.inf, 5.0, np.inf)
    (data,) = open_test_data([str(root)], "test")
    assert len(data.frames) == 3


def test_training_tuning_and_the_forest_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = scenes(tmp_path / "set", np.inf, np.inf)
    with pytest.raises(SystemExit) as end:
        main(["train", "regressor", "--data", str(root), "--out", str(tmp_path / "run"), "--preset", "tiny",
              "--crop", "128x64", "--steps", "2"])  # fmt: skip
    assert end.value.code == 1
    assert "no pixel of its 2 frames has ground truth (scene0/disp0.pfm" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    with pytest.raises(DatasetError, match="no pixel of its 2 frames"):
        validation_frames([open_source(f"{root}#0-1")], SimpleNamespace(), 5)  # type: ignore[arg-type]
    with pytest.raises(DatasetError, match="no pixel of its 2 frames"):
        train_forest([str(root)], tmp_path / "run", PLANS["tiny"])


def test_an_evaluation_says_what_it_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = scenes(tmp_path / "set", 5.0, 5.0)
    truth = np.full(SIZE, 5, np.float32)
    truth[:, :32] = 1e30
    write_pfm(root / "scene1" / "disp0.pfm", truth)
    right = SimpleNamespace(
        predict=lambda left, _: Prediction(np.full(left.shape[:2], 6, np.float32), None, None)
    )
    (data,) = open_test_data([str(root)], "test")
    evaluated = evaluate_set(data, Predictors(right, None))
    sentence = "12.50% of the disparities cannot be and are left out (12.50% larger than the picture is wide)"
    assert evaluated.facts["Ground truth"] == sentence
    said = capsys.readouterr().out
    assert f"set: {sentence}" in said
    assert "set: scene0 and 1 more: the left picture has one colour only" in said


def test_no_frames_have_no_share() -> None:
    assert mean_share([]) == ImpossibleShare()

"""`stereoforge train rdf` on a tiny data set and a regressor that knows nothing."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from datagen.sources.registry import open_source
from refine.forest import load_forest
from refine.forest.fitting import ForestConfig
from stereoforge.cli import main
from stereoforge.errors import CommandError
from stereoforge.pipelines.forest import ForestPlan, train_forest
from stereoforge.pipelines.prediction import open_predictors
from tests.training.synthetic import write_dataset
from training.networks import DispNetConfig, DispNetCorr1D
from training.runs.weights import TrainingSummary, save_weights


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("forest")
    torch.manual_seed(0)
    regressor = DispNetCorr1D(DispNetConfig(width=0.0625, prediction_scale=16.0))
    save_weights(
        folder / "run", "regressor", regressor, TrainingSummary("custom", 1, 0, (("d", 1.0),), best_step=0)
    )
    return write_dataset(folder / "data", 0, train=3, val=1), folder / "run"


def test_the_forest_joins_the_run_folder(world, capsys):
    data, run = world
    plan = ForestPlan(3, ForestConfig(trees=3, samples=3000, leaf_samples=20, correct_within_px=8.0))
    forest = train_forest([str(data)], run, plan)
    stored = load_forest(run / "rdf.safetensors")
    np.testing.assert_array_equal(stored.value, forest.value)
    sample = open_source(str(data)).frames("val")[0]
    # The synthetic set has no occlusion labels.
    bare = {
        name: getattr(sample, name)
        for name in ("name", "scene_name", "left", "right", "disparity_left", "size")
    }
    frame = open_predictors(run).frame(SimpleNamespace(**bare, occlusion_left=None, foreground_left=None))
    confidence = frame.other_confidences["rdf"]
    assert confidence.shape == frame.truth.shape
    assert ((confidence >= 0) & (confidence <= 1)).all()
    with pytest.raises(CommandError, match=r"rdf\.safetensors: is there already"):
        train_forest([str(data)], run, plan)
    with pytest.raises(SystemExit) as end:
        main(["train", "rdf", "--data", str(data), "--out", str(run), "--steps", "5"])
    assert end.value.code == 2
    assert "--steps is for networks" in capsys.readouterr().err

"""A run folder without all networks: what cannot run is said, and the command that would make it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from datagen.formats import write_png
from refine.registry import default_methods
from stereoforge.cli import main
from stereoforge.pipelines.prediction import untrained, untrained_notes
from tests.datagen.analytic_world import write_dataset
from training.networks import DispNetConfig, DispNetCorr1D
from training.runs.weights import TrainingSummary, save_weights


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    """With a regressor and nothing else."""
    network = DispNetCorr1D(DispNetConfig(width=1 / 16, max_displacement=4))
    save_weights(tmp_path / "run", "regressor", network, TrainingSummary("tiny", 1, 0, (), 1))
    return tmp_path / "run"


def told(capsys: pytest.CaptureFixture[str], code: int, *words: str | Path) -> str:
    """All that a command that ends with this code says, on one line."""
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    said = capsys.readouterr()
    assert int(end.value.code or 0) == code, said.err
    return " ".join((said.out + said.err).split())


def test_each_missing_network_is_named_with_its_command(run_folder: Path) -> None:
    rows = default_methods(("regressor", "regressor_f", "ours", "gradnet"))
    lacking = untrained(rows, run_folder, "networks")
    assert lacking == {"regressor_f": ["regressor_f"], "ours": ["confnet", "gradnet"], "gradnet": ["gradnet"]}
    assert untrained_notes(lacking, run_folder, "networks") == [
        f"{run_folder} has no {network}, so {methods} cannot run: stereoforge train {network} --data DATA --out "
        f"{run_folder} makes one"
        for network, methods in (
            ("regressor_f", "regressor_f"),
            ("confnet", "ours"),
            ("gradnet", "ours, gradnet"),
        )
    ]
    assert untrained(rows, run_folder, "sgbm") == {"regressor_f": ["regressor_f"]}


def test_commands_say_it_and_go_on_where_they_can(
    run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_dataset(tmp_path / "set", {"test": 1})
    common = (tmp_path / "set", "--weights", run_folder)
    report = ("evaluate", *common, "--out", tmp_path / "report", "--methods")
    remedy = "{0} cannot run: stereoforge train {1} --data DATA --out"
    assert remedy.format("ours", "confnet") in told(capsys, 1, *report, "ours")
    assert not (tmp_path / "report").exists()
    assert remedy.format("regressor_f", "regressor_f") in told(capsys, 0, *report, "regressor,regressor_f")
    numbers = json.loads((tmp_path / "report" / "results.json").read_text())["sets"][0]
    assert set(numbers["methods"]) == {"regressor"}
    assert remedy.format("ours", "gradnet") in told(capsys, 1, "tune", *common, "--methods", "ours")
    assert "nothing to tune" in told(capsys, 1, "tune", *common, "--methods", "regressor")
    write_png(tmp_path / "left.png", np.zeros((64, 64, 3), np.uint8))
    refined = ("refine", tmp_path / "left.png", tmp_path / "left.png", "--weights", run_folder)
    assert "train confnet" in told(capsys, 1, *refined, "--out", tmp_path / "refined")

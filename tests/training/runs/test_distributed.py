"""Several processes make the run of one with all their crops."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import safetensors.torch
import torch

from tests.training.runs.test_train import scalars
from tests.training.short_run import run
from tests.training.synthetic import write_dataset
from training.runs.weights import read_summary

STEPS = {"dispnet": 20, "costvolume": 4}
"""CostVolumeNet reads out around its best level. Rounding errors change which that is, sooner or later."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Truth is missing in some frames more than in others, so that processes count different numbers of pixels."""
    return write_dataset(tmp_path_factory.mktemp("set"), 0, train=4, val=1, unknown_rows=20)


@pytest.mark.slow
@pytest.mark.parametrize("network", ["dispnet", "costvolume"])
def test_two_processes_make_the_run_of_one_with_double_batch(
    network: str, data: Path, tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    program = Path(__file__).parents[1] / "short_run.py"
    done = subprocess.run(
        [*command, program, network, data, tmp_path / "two", "2", str(STEPS[network])],
        env={"PYTHONPATH": str(program.parents[2]), "PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    run(network, data, tmp_path / "one", 4, STEPS[network])

    if STEPS[network] == 20:  # the loss of every tenth step is logged
        losses = [scalars(tmp_path / name, "regressor", "train/loss") for name in ("one", "two")]
        assert losses[0].keys() == losses[1].keys() == {9, 19}
        np.testing.assert_allclose(list(losses[1].values()), list(losses[0].values()), rtol=1e-5)
    weights = [
        safetensors.torch.load_file(tmp_path / name / "regressor.safetensors") for name in ("one", "two")
    ]
    for name, tensor in weights[0].items():
        # Adam divides by the root of squared gradients, so where these are near 0 rounding moves a weight by more.
        torch.testing.assert_close(weights[1][name], tensor, rtol=1e-4, atol=5e-5)
    figures = [read_summary(tmp_path / name, "regressor").validation for name in ("one", "two")]
    assert figures[0] == pytest.approx(figures[1], rel=1e-4)

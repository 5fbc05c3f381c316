"""Runs killed with -9 at any moment end, resumed, with the weights of a run that was not."""

import multiprocessing
import random
import time
from pathlib import Path

import pytest
import safetensors.torch
import torch

from tests.training.short_run import VALIDATION_INTERVAL, run
from tests.training.synthetic import write_dataset

STEPS, KILLS = 60, 5


@pytest.mark.slow
def test_killed_at_random_moments(tmp_path: Path) -> None:
    data = write_dataset(tmp_path / "set", 0, train=3, val=1)
    # A server that has imported torch once forks every run: each starts within milliseconds.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.training.short_run"])

    def start(out: Path) -> multiprocessing.process.BaseProcess:
        process = context.Process(target=run, args=("dispnet", data, out, 1, STEPS, True))
        process.start()
        return process

    whole = start(tmp_path / "whole")
    whole.join()
    began = time.monotonic()
    whole_again = start(tmp_path / "whole-again")
    whole_again.join()
    between_checkpoints = (time.monotonic() - began) / (STEPS / VALIDATION_INTERVAL)
    assert whole.exitcode == whole_again.exitcode == 0

    # Moments counted from the run's own checkpoints, of which it has twelve: a machine that has
    # become several times faster or slower since the whole runs still kills within the run.
    rng = random.Random(0)
    checkpoint = tmp_path / "killed" / "logs" / "regressor" / "last.ckpt"
    kills = 0
    while kills < KILLS:
        before = written(checkpoint)
        process = start(tmp_path / "killed")
        while process.is_alive() and written(checkpoint) == before:
            time.sleep(0.005)
        process.join(rng.random() * between_checkpoints)
        if process.exitcode is not None:
            assert process.exitcode == 0
            break  # whole before the next kill
        process.kill()
        process.join()
        kills += 1
    assert kills > 0
    last = start(tmp_path / "killed")
    last.join()
    assert last.exitcode == 0

    expected = safetensors.torch.load_file(tmp_path / "whole" / "regressor.safetensors")
    for name in ("killed", "whole-again"):
        got = safetensors.torch.load_file(tmp_path / name / "regressor.safetensors")
        assert all(torch.equal(expected[key], got[key]) for key in expected)
    checkpoints = list((tmp_path / "killed" / "logs" / "regressor").glob("*.ckpt"))
    assert [path.name for path in checkpoints] == ["last.ckpt"]


def written(checkpoint: Path) -> int:
    """When the checkpoint was last replaced, in nanoseconds; 0 while there is none."""
    try:
        return checkpoint.stat().st_mtime_ns
    except FileNotFoundError:
        return 0

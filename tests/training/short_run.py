"""A short run on narrow networks, also as a program of its own: `short_run.py DATA OUT CROPS_A_STEP STEPS`."""

import sys
from dataclasses import replace
from pathlib import Path

import torch

from tests.training.running import train_quietly
from training.networks import DispNetConfig
from training.presets import RegressorPreset, find_preset

VALIDATION_INTERVAL = 5  # steps; also between checkpoints


def preset_of(crops: int) -> RegressorPreset:
    """The full preset but for its size: no normalisation layer, all stages of the loss."""
    full = find_preset("regressor", "full")
    assert isinstance(full, RegressorPreset)
    return replace(
        full,
        batch_size=crops,
        crop_width=128,
        crop_height=64,
        validation_interval=VALIDATION_INTERVAL,
        network=DispNetConfig(width=0.0625),
    )


def run(data: Path, out: Path, crops: int, steps: int, resume: bool = False) -> None:
    """Train with one thread; resumes where there is something to resume."""
    torch.set_num_threads(1)
    preset = preset_of(crops)
    train_quietly("regressor", [(data, 1.0)], out, preset, steps=steps, seed=1, resume=resume)


if __name__ == "__main__":
    run(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))

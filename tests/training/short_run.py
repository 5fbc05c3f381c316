"""A short run on narrow networks, also as a program of its own: `short_run.py NETWORK DATA OUT CROPS_A_STEP STEPS`."""

import sys
from dataclasses import replace
from pathlib import Path

import torch

from tests.training.running import train_quietly
from training.networks import CostVolumeConfig, DispNetConfig
from training.networks.regressors.interface import RegressorConfig
from training.preset_kinds import RegressorPreset
from training.presets import find_preset

VALIDATION_INTERVAL = 5  # steps; also between checkpoints


NARROW: dict[str, RegressorConfig] = {
    "dispnet": DispNetConfig(width=0.0625),
    "costvolume": CostVolumeConfig(
        stem=4, encoder=(8, 8, 8, 8), aggregation=(4, 4, 4, 4), look_channels=8, full_channels=4
    ),
}


def preset_of(network: str, crops: int) -> RegressorPreset:
    """The full preset but for its size: of DispNetCorr1D, all stages of the loss. Neither normalises by the batch."""
    full = find_preset("regressor", "full", network)
    assert isinstance(full, RegressorPreset)
    return replace(
        full,
        batch_size=crops,
        crop_width=128,
        crop_height=64,
        validation_interval=VALIDATION_INTERVAL,
        network=NARROW[network],
        fixed_statistics=1.0,
        optimizer=replace(full.optimizer, epsilon=1e-4),
    )


def run(network: str, data: Path, out: Path, crops: int, steps: int, resume: bool = False) -> None:
    """Train with one thread; resumes where there is something to resume."""
    torch.set_num_threads(1)
    preset = preset_of(network, crops)
    train_quietly("regressor", [(data, 1.0)], out, preset, steps=steps, seed=1, resume=resume)


if __name__ == "__main__":
    run(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]), int(sys.argv[5]))

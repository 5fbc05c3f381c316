"""Continuing from a trained regressor: parts that are frozen, another batch size, another learning rate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import safetensors.torch
import torch

from tests.training.running import train_quietly
from tests.training.synthetic import write_dataset
from training.errors import TrainingError
from training.preset_kinds import RegressorPreset
from training.presets import change_preset, find_preset


def quick(**changes: object) -> RegressorPreset:
    """A narrow CostVolumeNet on small crops."""
    preset = find_preset("regressor", "tiny", "costvolume")
    assert isinstance(preset, RegressorPreset)
    network = replace(
        preset.network,
        **{"stem": 4, "encoder": (8,) * 4, "aggregation": (4,) * 4, "look_channels": 8, "full_channels": 4},
    )
    small = {"crop_width": 64, "crop_height": 32, "validation_interval": 4, "network": network}
    return replace(preset, **(small | changes))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("set"), 0, train=4, val=1)


@pytest.fixture(scope="module")
def start(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder with a regressor of a few steps."""
    folder = tmp_path_factory.mktemp("start")
    train_quietly("regressor", [(data, 1.0)], folder, quick(), steps=4)
    return folder


def weights(run: Path) -> dict[str, torch.Tensor]:
    return safetensors.torch.load_file(run / "regressor.safetensors")


@pytest.mark.parametrize("fixed_statistics", [0.0, 0.5])
def test_frozen_parts_stay_as_they_were(
    data: Path, start: Path, tmp_path: Path, fixed_statistics: float
) -> None:
    """Neither their weights nor their BatchNorm's statistics change, and the others do."""
    preset = quick(frozen=("descriptors", "aggregation"), fixed_statistics=fixed_statistics)
    train_quietly("regressor", [(data, 1.0)], tmp_path, preset, steps=4, init=start)
    before, after = weights(start), weights(tmp_path)
    changed = {name.split(".")[0] for name in before if not torch.equal(before[name], after[name])}
    assert changed == {"look", "full_look", "half_weights"}


def test_parts_to_freeze_must_exist_and_leave_something(data: Path, start: Path, tmp_path: Path) -> None:
    source = [(data, 1.0)]
    with pytest.raises(TrainingError, match="has no part 'head' to freeze; it has descriptors, aggregation"):
        train_quietly("regressor", source, tmp_path / "a", quick(frozen=("head",)), init=start)
    everything = ("descriptors", "aggregation", "half_weights", "look", "full_look")
    with pytest.raises(TrainingError, match="nothing to train"):
        train_quietly("regressor", source, tmp_path / "b", quick(frozen=everything), init=start)
    with pytest.raises(TrainingError, match="frozen parts keep the weights of another run"):
        train_quietly("regressor", source, tmp_path / "c", quick(frozen=("look",)))


def test_a_learning_rate_and_a_batch_size_change_the_preset() -> None:
    preset = find_preset("confnet", "small")
    changed = change_preset(preset, {"learning_rate": 2e-4, "batch_size": 2})
    assert changed == replace(preset, batch_size=2, optimizer=replace(preset.optimizer, learning_rate=2e-4))

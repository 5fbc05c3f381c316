"""Training runs as the tests make them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from training.preset_kinds import Preset
from training.runs.request import TrainingRequest
from training.runs.train import train
from training.runs.weights import TrainingSummary


def train_quietly(
    task: str,
    data: Sequence[tuple[str | Path, float]],
    out: Path,
    preset: str | Preset = "small",
    **options: Any,
) -> TrainingSummary:
    """Train without a progress bar; the options are fields of `TrainingRequest`."""
    return train(TrainingRequest(task, tuple(data), out, preset, progress=False, **options))

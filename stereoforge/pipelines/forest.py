"""Train the random-forest confidence on the disparity of a run folder's regressor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from datagen.sources.ground_truth import require_ground_truth
from datagen.sources.registry import open_source
from datagen.sources.stereo_frame import StereoFrame
from refine.forest import Forest, save_forest
from refine.forest.fitting import ForestConfig, ForestFrame, grow_forest
from stereoforge.errors import CommandError
from stereoforge.pipelines.prediction import forest_file
from stereoforge.progress import progress_bar, remark
from stereoforge_kit.matching import left_right_consistency
from training.prediction.predictor import StereoPredictor


@dataclass(frozen=True)
class ForestPlan:
    """How much the forest learns from."""

    frames: int
    """Training frames at most, evenly spread."""
    config: ForestConfig = field(default_factory=ForestConfig)


PLANS = {
    "tiny": ForestPlan(20, ForestConfig(samples=60_000)),
    "small": ForestPlan(200),
    "full": ForestPlan(2000, ForestConfig(samples=4_000_000, leaf_samples=1000)),
}
"""By the names of the networks' presets."""


def train_forest(
    data: Sequence[str], out: Path, plan: ForestPlan, seed: int = 0, device: str = "cpu"
) -> Forest:
    """Predict training frames with the regressor in `out`, learn where it is right, and leave the forest there.

    Raises:
        CommandError: The folder has a forest already, or there is nothing to learn.
        DatasetError, TrainingError: Anything wrong with the data sets, such as no ground truth, or the regressor.
    """
    file = forest_file(out)
    if file.exists():
        raise CommandError(f"{file}: is there already; choose another folder or remove it")
    sources = [open_source(text) for text in data]
    samples = [sample for source in sources for sample in source.frames("train")]
    for source in sources:
        if note := source.note:
            remark(f"{source.location}: {note}")
    chosen = np.unique(np.linspace(0, len(samples) - 1, min(plan.frames, len(samples))).round().astype(int))
    require_ground_truth(", ".join(data), [samples[i] for i in chosen])
    predictor = StereoPredictor(out, device)
    with progress_bar() as progress:
        frames = progress.track(chosen, description="predicting for the forest")
        training_frames = (_forest_frame(samples[i], predictor) for i in frames)
        forest = grow_forest(training_frames, len(chosen), plan.config, seed)
    save_forest(file, forest, {"data": list(data), "frames": len(chosen), "seed": seed})
    return forest


def _forest_frame(sample: StereoFrame, predictor: StereoPredictor) -> ForestFrame:
    left, right = sample.left, sample.right
    disparity = predictor.predict(left, right).disparity
    consistency = left_right_consistency(disparity, predictor.predict_right(left, right))
    return ForestFrame(left, sample.disparity_left, disparity, consistency)

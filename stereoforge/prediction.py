"""From a pair of pictures to what the refinement and the evaluation take in."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from datagen.frame import StereoFrame
from refine.evaluation import EvaluationFrame
from refine.settings import FILE_NAME, Settings, read_settings
from training.predict import StereoPredictor
from training.weights import has_weights


@dataclass(frozen=True)
class Predictors:
    """Everything of a run folder that says something about a pair."""

    networks: StereoPredictor
    fine_tuned: StereoPredictor | None
    """The regressor fine-tuned on gradients, where there is one."""

    def frame(self, sample: StereoFrame) -> EvaluationFrame:
        """One sample with all that is predicted for it, and how long that took.

        Where nobody knows what is occluded, nothing is taken to be.
        """
        occlusion = sample.occlusion_left
        began = time.perf_counter()
        prediction = self.networks.predict(sample.left, sample.right)
        seconds = {"disparity": time.perf_counter() - began}
        fine_tuned = None
        if self.fine_tuned is not None:
            began = time.perf_counter()
            fine_tuned = self.fine_tuned.predict(sample.left, sample.right).disparity
            seconds["fine_tuned"] = time.perf_counter() - began
        return EvaluationFrame(
            name=sample.name,
            image=sample.left,
            truth=sample.disparity_left,
            occlusion=np.zeros(sample.size, np.uint8) if occlusion is None else occlusion,
            disparity=prediction.disparity,
            confidence=prediction.confidence,
            gradient=prediction.gradient,
            right=sample.right,
            fine_tuned=fine_tuned,
            seconds=seconds,
        )


def open_predictors(run: Path, device: str = "cpu") -> Predictors:
    """What a run folder holds; raises TrainingError, naming what is wrong."""
    return Predictors(
        networks=StereoPredictor(run, device),
        fine_tuned=(StereoPredictor(run, device, "regressor_f") if has_weights(run, "regressor_f") else None),
    )


def open_settings(file: Path | None, run: Path | None) -> Settings:
    """The methods' parameters: of the file, or of the one in the run folder, or the defaults."""
    if file is not None:
        return read_settings(file)
    if run is not None and (run / FILE_NAME).exists():
        return read_settings(run / FILE_NAME)
    return Settings()

"""Predictions for a pair: the inputs of refinement and evaluation."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from datagen.sources.stereo_frame import StereoFrame
from refine.evaluation.evaluate import EvaluationFrame
from refine.evaluation.settings import Settings, read_settings
from refine.forest import Forest, load_forest
from refine.heuristic_inputs import consistency_confidence, local_gradients
from refine.method import Method
from stereoforge_kit.matching import SGBMParameters, fill_background, left_right_consistency, match_both
from training.devices import PredictionPrecision
from training.prediction.predictor import Prediction, RegressorFreePredictor, StereoPredictor
from training.runs.weights import has_weights, weights_path

PredictorName = Literal["networks", "sgbm"]

Image = NDArray[np.uint8]
Map = NDArray[np.float32]


class PairPredictor(Protocol):
    """A predictor of a disparity for a pair, and of confidence and gradients where it knows them."""

    def predict(self, left: Image, right: Image) -> Prediction: ...


@dataclass(frozen=True)
class Judge:
    """The regressor-free networks of a run folder, or heuristics where it has none."""

    networks: RegressorFreePredictor

    def judge(self, left: Image, right: Image, disparity: Map, disparity_right: Map) -> Prediction:
        """Confidence and gradients of a disparity (H, W), whose holes are filled from the background."""
        judged = self.networks.predict(left, right, disparity, disparity_right)
        confidence, gradient = judged.confidence, judged.gradient
        if confidence is None:
            consistency = left_right_consistency(disparity, disparity_right)
            confidence = consistency_confidence(disparity, consistency, left)
        if gradient is None:
            gradient = local_gradients(disparity, confidence, left)
        return Prediction(fill_background(disparity), confidence, gradient)


@dataclass(frozen=True)
class JudgedRegressor(Judge):
    """A regressor without heads of its own, judged by the regressor-free networks."""

    regressor: StereoPredictor

    def predict(self, left: Image, right: Image) -> Prediction:
        """The regressor's disparity of both views, and what the networks say of it."""
        disparity = self.regressor.predict(left, right).disparity
        return self.judge(left, right, disparity, self.predict_right(left, right))

    def predict_right(self, left: Image, right: Image) -> Map:
        """The regressor's disparity (H, W) px of the right view."""
        return self.regressor.predict_right(left, right)


@dataclass(frozen=True)
class MatchingPredictor(Judge):
    """Semi-global matching, or a given disparity, judged by the regressor-free networks or by heuristics."""

    matcher: SGBMParameters

    def predict(self, left: Image, right: Image) -> Prediction:
        """Match the pair; return disparity, confidence and gradients."""
        return self.judge(left, right, *match_both(left, right, self.matcher))

    def predict_for(
        self, left: Image, right: Image, disparity: Map, disparity_right: Map | None
    ) -> Prediction:
        """Predict confidence and gradients of a given disparity (H, W), NaN in holes. The right view's disparity is
        matched where it is not given."""
        if disparity_right is None:
            reach = max(self.matcher.max_disparity_px, math.ceil(float(np.nanmax(disparity))) + 16)
            matcher = replace(self.matcher, max_disparity_px=min(reach, left.shape[1]))
            disparity_right = match_both(left, right, matcher)[1]
        return self.judge(left, right, disparity, disparity_right)


@dataclass(frozen=True)
class Predictors:
    """All predictors of a run folder."""

    initial: PairPredictor
    """Gives the disparity that is refined."""
    fine_tuned: StereoPredictor | None
    """The regressor fine-tuned on gradients, where there is one."""
    forest: Forest | None = None
    """The random forest on the initial disparity, where there is one."""

    def frame(self, sample: StereoFrame) -> EvaluationFrame:
        """One sample with all that is predicted for it, and how long that took.

        Where nobody knows what is occluded, nothing is taken to be.
        """
        occlusion = sample.occlusion_left
        left, right = sample.left, sample.right  # Read here: decoding and hashing are not the networks' time.
        began = time.perf_counter()
        prediction = self.initial.predict(left, right)
        seconds = {"disparity": time.perf_counter() - began}
        fine_tuned = None
        if self.fine_tuned is not None:
            began = time.perf_counter()
            fine_tuned = self.fine_tuned.predict(left, right).disparity
            seconds["fine_tuned"] = time.perf_counter() - began
        return EvaluationFrame(
            name=sample.name,
            image=left,
            truth=sample.disparity_left,
            occlusion=np.zeros(sample.size, np.uint8) if occlusion is None else occlusion,
            disparity=prediction.disparity,
            confidence=prediction.confidence,
            gradient=prediction.gradient,
            right=right,
            fine_tuned=fine_tuned,
            objects=sample.foreground_left,
            scene=sample.scene_name,
            other_confidences={}
            if self.forest is None
            else {"rdf": self._forest_confidence(sample, prediction)},
            seconds=seconds,
        )

    def _forest_confidence(self, sample: StereoFrame, prediction: Prediction) -> Map:
        assert self.forest is not None
        assert isinstance(self.initial, StereoPredictor | JudgedRegressor)
        consistency = left_right_consistency(
            prediction.disparity, self.initial.predict_right(sample.left, sample.right)
        )
        return self.forest.confidence(prediction.disparity, consistency, sample.left)


def open_predictors(
    run: Path,
    device: str = "cpu",
    predictor: PredictorName = "networks",
    max_disparity: int | None = None,
) -> Predictors:
    """Open the networks of a run folder, or semi-global matching with its regressor-free ones.

    Args:
        run: Run folder.
        device: As `training.devices.parse_device` takes it.
        predictor: What gives the disparity.
        max_disparity: Largest disparity in pixels to look for; None leaves it to the predictor.

    Raises:
        TrainingError: Names what is wrong.
    """
    if predictor == "sgbm":
        return Predictors(open_matching(run, device, max_disparity), None)
    fine_tuned = None
    if has_weights(run, "regressor_f"):
        fine_tuned = StereoPredictor(run, device, "regressor_f", max_disparity, "auto")
    return Predictors(
        initial=open_regressor(run, device, max_disparity),
        fine_tuned=fine_tuned,
        forest=load_forest(forest_file(run)) if forest_file(run).exists() else None,
    )


def open_regressor(
    run: Path,
    device: str = "cpu",
    max_disparity: int | None = None,
    precision: PredictionPrecision = "auto",
) -> StereoPredictor | JudgedRegressor:
    """The regressor of a run folder with its heads or, where it has none, with the regressor-free networks."""
    regressor = StereoPredictor(run, device, max_disparity=max_disparity, precision=precision)
    if judged_by(run) == HEADS:
        return regressor
    return JudgedRegressor(RegressorFreePredictor(run, device), regressor)


HEADS = ("confnet", "gradnet")
"""The networks that judge the disparity of the regressor they were trained on."""
FREE_HEADS = ("confnet_free", "gradnet_free")
"""The networks that judge the disparity of any predictor."""


def judged_by(run: Path) -> tuple[str, str]:
    """The networks that judge the regressor's disparity in a run folder: heads of its own, unless there are none and
    both regressor-free networks are there."""
    own = any(has_weights(run, task) for task in HEADS)
    return FREE_HEADS if not own and all(has_weights(run, task) for task in FREE_HEADS) else HEADS


def predicting(run: Path, predictor: PredictorName = "networks") -> tuple[str, ...]:
    """The networks that fill the fields of `EvaluationFrame` that methods look at."""
    return FREE_HEADS if predictor == "sgbm" else ("regressor", *judged_by(run), "regressor_f")


def network_digests(run: Path, predictor: PredictorName = "networks") -> dict[str, str]:
    """SHA-256 of the weights of each network that predicts, of those a run folder has."""
    return {
        task: hashlib.sha256(weights_path(run, task).read_bytes()).hexdigest()
        for task in predicting(run, predictor)
        if has_weights(run, task)
    }


def forest_file(run: Path) -> Path:
    """Where a run folder keeps its random forest."""
    return run / "rdf.safetensors"


def open_matching(run: Path, device: str = "cpu", max_disparity: int | None = None) -> MatchingPredictor:
    """Semi-global matching up to a disparity in pixels, with the regressor-free networks of a run folder."""
    matcher = SGBMParameters()
    if max_disparity is not None:
        matcher = replace(matcher, max_disparity_px=max_disparity)
    return MatchingPredictor(RegressorFreePredictor(run, device), matcher)


def fallback_notes(run: Path) -> list[str]:
    """A sentence for each network that the run folder lacks for a disparity from another predictor."""
    notes = []
    for task, instead in (
        ("confnet_free", "confidence is taken from left-right consistency and texture"),
        ("gradnet_free", "slopes are taken from the disparity itself"),
    ):
        if not has_weights(run, task):
            notes.append(f"without a {task} ({run} has none), {instead}")
    return notes


def train_command(network: str, run: Path) -> str:
    """The command that trains a network into a run folder."""
    return f"stereoforge train {network} --data DATA --out {run}"


def untrained(methods: Sequence[Method], run: Path, predictor: PredictorName) -> dict[str, list[str]]:
    """Methods by name that a run folder does not serve, and the networks it lacks for each.

    Semi-global matching needs none: heuristics stand in for missing networks. It has no fine-tuned counterpart.
    """
    networks = {"fine_tuned": "regressor_f"}
    if predictor == "networks":
        networks |= dict(zip(("confidence", "gradient"), judged_by(run), strict=True))
    lacking = {
        method.name: [
            network
            for needed, network in networks.items()
            if needed in method.needs and (predictor == "sgbm" or not has_weights(run, network))
        ]
        for method in methods
    }
    return {name: missing for name, missing in lacking.items() if missing}


def untrained_notes(lacking: Mapping[str, Sequence[str]], run: Path, predictor: PredictorName) -> list[str]:
    """A sentence for each network that methods have to do without (`untrained`), and what makes one."""
    needed_by: dict[str, list[str]] = {}
    for method, networks in lacking.items():
        for network in networks:
            needed_by.setdefault(network, []).append(method)
    notes = []
    for network, methods in needed_by.items():
        if predictor == "networks":
            reason, remedy = f"{run} has no {network}", f": {train_command(network, run)} makes one"
        else:
            reason, remedy = "semi-global matching has no fine-tuned counterpart", ""
        notes.append(f"{reason}, so {', '.join(methods)} cannot run{remedy}")
    return notes


def parameters_file(run: Path, predictor: PredictorName = "networks") -> Path:
    """Where a run folder keeps validated parameters: those that suit its networks, or another predictor."""
    return run / ("parameters.json" if predictor == "networks" else f"parameters_{predictor}.json")


def open_settings(file: Path | None, run: Path, predictor: PredictorName = "networks") -> Settings:
    """The methods' parameters: of the file, or of the one in the run folder, or the defaults."""
    if file is not None:
        return read_settings(file)
    if parameters_file(run, predictor).exists():
        return read_settings(parameters_file(run, predictor))
    return Settings()

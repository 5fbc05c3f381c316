"""Pairs of pictures to refined disparities, with networks that are read once."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.cameras.calibration import Calibration
from datagen.cameras.reprojection import depth_of_disparity
from refine.energy.system import Form
from refine.methods.ours import Ours
from refine.mrf.solve import SolveInfo
from stereoforge.bundled_weights import BUNDLED_WEIGHTS, named_weights
from stereoforge.errors import CommandError
from stereoforge.pipelines.prediction import (
    HEADS,
    Image,
    Map,
    MatchingPredictor,
    PairPredictor,
    PredictorName,
    fallback_notes,
    network_digests,
    open_matching,
    open_regressor,
    open_settings,
    train_command,
)
from stereoforge_kit.allocation import give_back_freed_memory, keep_freed_memory
from stereoforge_kit.errors import InputError
from training.devices import PredictionPrecision
from training.prediction.predictor import Prediction

KEPT_UP_TO_PIXELS = 2_100_000
"""Larger pictures shall not take more memory than they need."""
GIVEN_BACK_EVERY = 8
"""After so many pairs what is kept is given back, so that a long folder takes no more than a short one."""


@dataclass(frozen=True)
class RefinedPair:
    """What `StereoRefiner` found for one pair."""

    disparity: Map
    """(H, W) px of the left view, refined."""
    initial: Map
    """(H, W) px: the predictor's disparity, its holes filled."""
    confidence: Map
    """(H, W) in 0..1: how far the initial disparity was trusted."""
    gradient: Map
    """(H, W, 2) forward differences [dx, dy] in px per px that were expected."""
    deviation: Map | None
    """(H, W) px, standard deviation of the refined disparity; None where it was not asked for."""
    info: SolveInfo
    """How the MRF was solved."""

    def depth(self, calibration: Calibration) -> NDArray[np.float64]:
        """Depth (H, W) in metres along the optical axis; infinite where the disparity is that of infinity or beyond.

        Args:
            calibration: Of the pair.

        Raises ValueError for a calibration of images of another size.

        Examples:
            A rig of 500 px and 0.1 m sees a point with a disparity of 10 px at 5 m.
        """
        return depth_of_disparity(self.disparity, calibration)


class StereoRefiner:
    """Predicts the disparity of rectified pairs and refines it.

    The networks are read once, and the solver's kernels stay compiled, so the second pair takes less time than the
    first. The process keeps what it frees for some pairs, unless pictures are large (`keep_freed_memory`).

    Examples:
        refiner = StereoRefiner()
        pair = refiner(left, right)  # (H, W, 3) uint8 each
        pair.disparity, pair.confidence
    """

    def __init__(
        self,
        weights: Path | str = BUNDLED_WEIGHTS,
        *,
        predictor: PredictorName = "networks",
        parameters: Path | None = None,
        form: Form | None = None,
        max_disparity: int | None = None,
        device: str = "auto",
        precision: PredictionPrecision = "auto",
    ) -> None:
        """Read networks and parameters.

        Args:
            weights: Run folder, or `paper` for the bundled networks of the paper.
            predictor: What gives the disparity: the run folder's networks, or semi-global matching.
            parameters: File of MRF parameters, as `stereoforge tune` writes them; None takes the run folder's, or the
                defaults.
            form: Refine by the paper's quadratic MRF in this form; None refines as the parameters say.
            max_disparity: Largest disparity in pixels to look for; None leaves it to the predictor.
            device: As `training.devices.parse_device` takes it.
            precision: Bits of the convolutions of a run folder's networks: `32`, `bf16`, or `auto`, which is bf16 on
                processors that multiply it in hardware. Disparities differ by about 0.03 px in the mean.

        Raises:
            CommandError: the run folder has no heads for its regressor.
            TrainingError: anything else that is wrong with the run folder or the device.
        """
        run = named_weights(Path(weights))
        settings = open_settings(parameters, run, predictor)
        self._method: Ours = settings.ours
        if form is not None:
            self._method = replace(settings.ours_quadratic, form=form)
        self._matching: MatchingPredictor | None = None
        self._predictor: PairPredictor
        self._pairs = 0
        self.notes: list[str] = []
        """A sentence for each network that heuristics stand in for."""
        if predictor == "sgbm":
            self._predictor = self._matching = open_matching(run, device, max_disparity)
            self.notes = fallback_notes(run)
        else:
            self._predictor = open_regressor(run, device, max_disparity, precision)
        self._run = run
        self.settings: dict[str, Any] = {
            "predictor": predictor,
            "networks": network_digests(run, predictor),
            "method": json.loads(json.dumps(asdict(self._method))),
            "max_disparity": max_disparity,
            "precision": precision,
        }
        """What decides the results, as JSON values."""

    def __call__(
        self,
        left: Image,
        right: Image,
        *,
        disparity: Map | None = None,
        disparity_right: Map | None = None,
        deviation_samples: int = 0,
    ) -> RefinedPair:
        """Refine one pair.

        Args:
            left, right: (H, W, 3) uint8 sRGB, rectified, of one size.
            disparity: (H, W) px of the left view by another predictor, NaN in holes; needs `predictor="sgbm"`, which
                matches what is not given.
            disparity_right: (H, W) px of the right view, which tells how far to trust the left one's.
            deviation_samples: Samples of the posterior that the deviation is measured from; 32 are off by an eighth of
                it. 0 leaves it out.

        Raises:
            CommandError: views of different sizes, or a run folder without heads.
            TrainingError: arrays of another kind.
        """
        prediction = self.predict(left, right, disparity=disparity, disparity_right=disparity_right)
        return self.refine(left, prediction, deviation_samples=deviation_samples)

    def refine(
        self, left: Image, prediction: Prediction, *, strength: float = 1.0, deviation_samples: int = 0
    ) -> RefinedPair:
        """Refine what `predict` found, which is kept to refine it in several ways.

        Args:
            left: (H, W, 3) uint8 sRGB, the left view.
            prediction: What `predict` found for it.
            strength: Factor on the energy's gradient and colour terms, against how far the initial disparity is
                trusted: 1 refines as validated, more follows the predicted slopes more closely.
            deviation_samples: As in a call.

        Raises:
            CommandError: a run folder without heads.
            InputError: a strength that is not positive.
        """
        if not 0 < strength < math.inf:
            raise InputError(f"the strength of a refinement must be positive, got {strength}")
        confidence, gradient = prediction.confidence, prediction.gradient
        for name, found in zip(HEADS, (confidence, gradient), strict=True):
            if found is None:
                raise CommandError(
                    f"{self._run}: has no {name}, which refining needs: {train_command(name, self._run)} makes one"
                )
        assert confidence is not None
        assert gradient is not None
        inputs = (prediction.disparity, confidence, gradient, left)
        method = self._method if strength == 1 else _strengthened(self._method, strength)
        solution = method.solve(*inputs)
        return RefinedPair(
            disparity=solution.disparity.astype(np.float32),
            initial=prediction.disparity,
            confidence=confidence,
            gradient=gradient,
            deviation=method.sample(*inputs, deviation_samples) if deviation_samples else None,
            info=solution.info,
        )

    def batch(self, pairs: Iterable[tuple[Image, Image]]) -> Iterator[RefinedPair]:
        """Refine pairs one after the other, each as it is asked for."""
        for left, right in pairs:
            yield self(left, right)

    def predict(
        self,
        left: Image,
        right: Image,
        *,
        disparity: Map | None = None,
        disparity_right: Map | None = None,
    ) -> Prediction:
        """Predict what `refine` takes. Arguments and errors as for a call."""
        if left.shape != right.shape:
            raise CommandError(
                f"the images differ in size: left {left.shape[1]}x{left.shape[0]}, "
                f"right {right.shape[1]}x{right.shape[0]}"
            )
        keep_freed_memory(left.shape[0] * left.shape[1] <= KEPT_UP_TO_PIXELS)
        self._pairs += 1
        if self._pairs % GIVEN_BACK_EVERY == 0:
            give_back_freed_memory()
        if disparity is None:
            return self._predictor.predict(left, right)
        if self._matching is None:
            raise CommandError('a disparity of another predictor needs predictor="sgbm"')
        return self._matching.predict_for(left, right, disparity, disparity_right)


def _strengthened(method: Ours, strength: float) -> Ours:
    parameters = method.parameters
    return replace(
        method,
        parameters=replace(parameters, alpha=parameters.alpha * strength, beta=parameters.beta * strength),
    )

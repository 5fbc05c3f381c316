"""Prediction with a run folder's networks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from training.errors import TrainingError
from training.networks import ConfNet, DispNetCorr1D, GradNet
from training.networks.cost_features import CostFeatures
from training.networks.inference import estimate
from training.networks.regressor_free import RegressorFreeInputs, regressor_free_inputs
from training.runs.weights import has_weights, load_confnet, load_gradnet, load_regressor, on_regressor


@dataclass(frozen=True)
class Prediction:
    """What the networks say about one pair."""

    disparity: NDArray[np.float32]
    """(H, W) px of the input, left view."""
    confidence: NDArray[np.float32] | None
    """(H, W) in 0..1, or None without a ConfNet."""
    gradient: NDArray[np.float32] | None
    """(H, W, 2) forward differences [dx, dy], or None without a GradNet."""


class StereoPredictor:
    """The networks of a run folder, ready to predict.

    Images are resized (not padded) to multiples of 64, as the original network's are, and the answers resized back.
    """

    def __init__(self, run: Path | str, device: str = "cpu", regressor: str = "regressor") -> None:
        """Read what the folder holds; ConfNet and GradNet are optional.

        Args:
            regressor: `regressor`, or `regressor_f`, whose disparity comes without confidence and gradient: those
                networks know the features of the `regressor` only.

        Raises:
            TrainingError: no regressor, damaged files, or a ConfNet or GradNet trained on another regressor.
        """
        run = Path(run)
        self._device = torch.device(device)
        stored = load_regressor(run, regressor)
        self._regressor = stored.network.to(self._device)
        self._confnet: ConfNet | None = None
        self._gradnet: GradNet | None = None
        if regressor == "regressor" and has_weights(run, "confnet"):
            self._confnet = on_regressor(run, "confnet", load_confnet(run), stored.sha256).to(self._device)
        if regressor == "regressor" and has_weights(run, "gradnet"):
            self._gradnet = on_regressor(run, "gradnet", load_gradnet(run), stored.sha256).to(self._device)

    @property
    def networks(self) -> tuple[DispNetCorr1D, ConfNet | None, GradNet | None]:
        """The networks, in evaluation mode."""
        return self._regressor, self._confnet, self._gradnet

    def predict(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> Prediction:
        """Predict the left view's maps.

        Args:
            left, right: (H, W, 3) uint8 sRGB, rectified.

        Raises:
            TrainingError: images of another kind, or of different sizes.
        """
        check_images(left, right)
        answer = estimate(
            self._regressor,
            self._confnet,
            self._gradnet,
            _as_tensor(left, self._device),
            _as_tensor(right, self._device),
        )
        return Prediction(
            disparity=_as_array(answer.disparity)[..., 0],
            confidence=None if answer.confidence is None else _as_array(answer.confidence)[..., 0],
            gradient=None if answer.gradient is None else _as_array(answer.gradient),
        )

    def predict_right(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        """The right view's disparity (H, W): that of the mirrored, swapped pair, mirrored back. As `predict`."""
        check_images(left, right)
        views = (_as_tensor(image[:, ::-1], self._device) for image in (right, left))
        mirrored = _as_array(estimate(self._regressor, None, None, *views).disparity)[..., 0]
        return np.ascontiguousarray(mirrored[:, ::-1])


class RegressorFreePredictor:
    """ConfNet and GradNet of a run folder for the disparity of any predictor (`confnet_free`, `gradnet_free`)."""

    def __init__(self, run: Path | str, device: str = "cpu") -> None:
        """Read what the folder holds, both networks being optional.

        Raises:
            TrainingError: no such folder, or damaged files.
        """
        run = Path(run)
        if not run.is_dir():
            raise TrainingError(f"{run}: there is no such run folder")
        self._device = torch.device(device)
        self._confnet: ConfNet | None = None
        self._gradnet: GradNet | None = None
        if has_weights(run, "confnet_free"):
            self._confnet = load_confnet(run, "confnet_free").network.to(self._device)
        if has_weights(run, "gradnet_free"):
            self._gradnet = load_gradnet(run, "gradnet_free").network.to(self._device)

    @torch.no_grad()
    def predict(
        self,
        left: NDArray[np.uint8],
        right: NDArray[np.uint8],
        disparity: NDArray[np.float32],
        disparity_right: NDArray[np.float32],
    ) -> Prediction:
        """Confidence and gradient of a left view's disparity; the disparity itself with its holes filled.

        Args:
            left, right: (H, W, 3) uint8 sRGB.
            disparity, disparity_right: (H, W) px, NaN in holes; the right view's confirms the left view's.

        Raises:
            TrainingError: images of another kind, or arrays of different sizes.
        """
        check_images(left, right)
        for name, maps in (("left", disparity), ("right", disparity_right)):
            if maps.shape != left.shape[:2]:
                raise TrainingError(
                    f"the {name} disparity is {maps.shape[1]}x{maps.shape[0]}, "
                    f"the image {left.shape[1]}x{left.shape[0]}"
                )
        inputs = RegressorFreeInputs(
            *(maps.to(self._device) for maps in regressor_free_inputs(disparity, disparity_right))
        )
        image, other = (_as_tensor(view, self._device) for view in (left, right))
        cost_features = CostFeatures(image, other, inputs.disparity)
        confidence = gradient = None
        if self._confnet is not None:
            seen = self._confnet.inputs(inputs.features, inputs.consistency, cost_features)
            confidence = _as_array(self._confnet.confidence(*seen))[..., 0]
        if self._gradnet is not None:
            seen = self._gradnet.inputs(inputs.features, cost_features)
            gradient = _as_array(self._gradnet(*seen))
        return Prediction(_as_array(inputs.disparity)[..., 0], confidence, gradient)


def check_images(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> None:
    """Raise TrainingError unless both are (H, W, 3) of uint8, not empty, and alike."""
    for name, image in (("left", left), ("right", right)):
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            raise TrainingError(
                f"the {name} image must be (H, W, 3) of uint8, got {image.shape} of {image.dtype}"
            )
    if left.shape != right.shape:
        raise TrainingError(
            f"the images differ in size: left {left.shape[1]}x{left.shape[0]}, "
            f"right {right.shape[1]}x{right.shape[0]}"
        )


def _as_tensor(image: NDArray[np.uint8], device: torch.device) -> Tensor:
    batch = torch.from_numpy(np.ascontiguousarray(image)).permute(2, 0, 1)[None]
    return batch.to(device).float() / 255


def _as_array(maps: Tensor) -> NDArray[np.float32]:
    return np.ascontiguousarray(maps[0].permute(1, 2, 0).cpu().numpy())

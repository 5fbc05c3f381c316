"""Prediction with the networks of a run folder, from arrays to arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from training.devices import PredictionPrecision, computes_in_bfloat16, parse_device
from training.errors import TrainingError
from training.networks import ConfNet, GradNet, Regressor
from training.networks.cost_features import CostFeatures
from training.networks.inference import Estimate, estimate
from training.networks.layout import prepare_for_prediction
from training.networks.regressor_free import RegressorFreeInputs, regressor_free_inputs
from training.runs.weights import (
    has_weights,
    load_confnet,
    load_gradnet,
    load_regressor,
    on_regressor,
    require_run_folder,
)


@dataclass(frozen=True)
class Prediction:
    """The networks' outputs for one pair."""

    disparity: NDArray[np.float32]
    """(H, W) px of the left view, at the images' resolution."""
    confidence: NDArray[np.float32] | None
    """(H, W) in 0..1, or None without a ConfNet."""
    gradient: NDArray[np.float32] | None
    """(H, W, 2) forward differences [dx, dy] in px per px, or None without a GradNet."""


class StereoPredictor:
    """The networks of a run folder, ready to predict.

    Images of any size are brought to those that the regressor takes (`Regressor.fitting`), and the outputs back.
    """

    def __init__(
        self,
        run: Path | str,
        device: str = "cpu",
        regressor: str = "regressor",
        max_disparity: int | None = None,
        precision: PredictionPrecision = "32",
    ) -> None:
        """Read the regressor, and ConfNet and GradNet if the folder has them.

        Args:
            run: Run folder.
            device: As `training.devices.parse_device` takes it.
            regressor: `regressor`, or `regressor_f`. The latter's disparity comes without confidence and gradient,
                since those networks were trained on the features of `regressor`.
            max_disparity: Largest disparity in pixels to look for; None leaves it to the regressor.
            precision: Bits of the convolutions. bfloat16 moves disparities by about 0.03 px in the mean.

        Raises:
            TrainingError: no regressor, no such device, damaged files, a ConfNet or GradNet trained on another
                regressor, or a regressor whose largest disparity cannot be set.
        """
        run = Path(run)
        self._device = parse_device(device)
        self._bfloat16 = computes_in_bfloat16(precision, self._device)
        stored = load_regressor(run, regressor)
        self._regressor = stored.network.to(self._device)
        if max_disparity is not None:
            self._regressor.look_up_to(max_disparity)
        self._confnet: ConfNet | None = None
        self._gradnet: GradNet | None = None
        if regressor == "regressor" and has_weights(run, "confnet"):
            self._confnet = on_regressor(run, "confnet", load_confnet(run), stored.sha256).to(self._device)
        if regressor == "regressor" and has_weights(run, "gradnet"):
            self._gradnet = on_regressor(run, "gradnet", load_gradnet(run), stored.sha256).to(self._device)
        _prepare(*self.networks)

    @property
    def networks(self) -> tuple[Regressor, ConfNet | None, GradNet | None]:
        """The networks, in evaluation mode."""
        return self._regressor, self._confnet, self._gradnet

    def predict(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> Prediction:
        """Predict disparity, confidence and gradient of the left view.

        Args:
            left, right: (H, W, 3) uint8 sRGB, rectified.

        Raises:
            TrainingError: images of another kind, or of different sizes.
        """
        check_images(left, right)
        found = self._estimate(*self.networks, left, right)
        return Prediction(
            disparity=_as_array(found.disparity)[..., 0],
            confidence=None if found.confidence is None else _as_array(found.confidence)[..., 0],
            gradient=None if found.gradient is None else _as_array(found.gradient),
        )

    def predict_right(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Predict the right view's disparity (H, W) px: that of the swapped views, mirrored.

        Arguments and errors as for `predict`.
        """
        check_images(left, right)
        found = self._estimate(self._regressor, None, None, right[:, ::-1], left[:, ::-1])
        return np.ascontiguousarray(_as_array(found.disparity)[:, ::-1, 0])

    def _estimate(
        self,
        regressor: Regressor,
        confnet: ConfNet | None,
        gradnet: GradNet | None,
        left: NDArray[np.uint8],
        right: NDArray[np.uint8],
    ) -> Estimate:
        views = (_as_tensor(image, self._device) for image in (left, right))
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._bfloat16):
            return estimate(regressor, confnet, gradnet, *views)


class RegressorFreePredictor:
    """The regressor-free ConfNet and GradNet of a run folder (`confnet_free`, `gradnet_free`).

    They judge the disparity of any predictor (ours).
    """

    def __init__(self, run: Path | str, device: str = "cpu") -> None:
        """Read the networks that the folder has; it may have none.

        Args:
            run: Run folder.
            device: As `training.devices.parse_device` takes it.

        Raises:
            TrainingError: no such folder, no such device, or damaged files.
        """
        run = Path(run)
        require_run_folder(run)
        self._device = parse_device(device)
        self._confnet: ConfNet | None = None
        self._gradnet: GradNet | None = None
        if has_weights(run, "confnet_free"):
            self._confnet = load_confnet(run, "confnet_free").network.to(self._device)
        if has_weights(run, "gradnet_free"):
            self._gradnet = load_gradnet(run, "gradnet_free").network.to(self._device)
        _prepare(self._confnet, self._gradnet)

    @torch.no_grad()
    def predict(
        self,
        left: NDArray[np.uint8],
        right: NDArray[np.uint8],
        disparity: NDArray[np.float32],
        disparity_right: NDArray[np.float32],
    ) -> Prediction:
        """Predict confidence and gradient of a disparity from another predictor.

        Args:
            left, right: (H, W, 3) uint8 sRGB, rectified.
            disparity, disparity_right: (H, W) px of the left and the right view, NaN in holes. The left view's is
                judged, and compared with the right view's.

        Returns:
            The left view's disparity with its holes filled from the background, its confidence and its gradient.

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


def _prepare(*networks: nn.Module | None) -> None:
    """Make the networks that there are faster."""
    for network in networks:
        if network is not None:
            prepare_for_prediction(network)


def check_images(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> None:
    """Check that both images are (H, W, 3) uint8, not empty, and of one size.

    Raises:
        TrainingError: they are not.
    """
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
    # Copied: PyTorch takes no arrays that must not be written, such as Pillow's, without a warning.
    batch = torch.from_numpy(np.array(image)).permute(2, 0, 1)[None]
    return batch.to(device).float() / 255


def _as_array(maps: Tensor) -> NDArray[np.float32]:
    return np.ascontiguousarray(maps[0].permute(1, 2, 0).cpu().numpy())

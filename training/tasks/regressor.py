"""Training a regressor: from scratch with its own objective, and fine-tuning with eq. 9."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

from stereoforge_kit.viewing import Picture, disparity_picture, error_picture, side_by_side
from training.data.batch import StereoBatch
from training.losses import gradient_aware_l1
from training.metrics import bad_pixel_rate, end_point_error, forward_gradient, gradient_error
from training.networks import Regressor
from training.networks.inference import estimate, regress
from training.presets import FineTuningPreset, RegressorPreset
from training.tasks.base import StereoTask, image_of, map_of

SMOOTH_WITHIN_PX = 1.0
"""Gradient errors are reported where no true forward difference is above this."""


class _DisparityTask(StereoTask):
    monitor = "validation/epe"
    network: Regressor

    def decayed_parameters(self) -> Iterable[nn.Parameter]:
        """Those that the network names."""
        return self.network.decayed_parameters()

    def validate_frame(self, batch: StereoBatch) -> tuple[dict[str, float], dict[str, Tensor]]:
        """End-point error, bad-pixel rates and gradient error of the disparity."""
        disparity = estimate(self.kept_network, None, None, batch.left, batch.right).disparity
        truth = batch.disparity
        figures = {
            "epe": end_point_error(disparity, truth),
            "bad1": bad_pixel_rate(disparity, truth, 1.0),
            "bad3": bad_pixel_rate(disparity, truth, 3.0),
            "gradient": gradient_error(forward_gradient(disparity), batch.gradient, SMOOTH_WITHIN_PX),
        }
        return figures, {"disparity": disparity}

    def panel(self, batch: StereoBatch, maps: dict[str, Tensor]) -> Picture:
        """Image, true disparity, predicted disparity and its error."""
        truth, disparity = map_of(batch.disparity), map_of(maps["disparity"])
        nearest = float(torch.nan_to_num(batch.disparity).max())
        return side_by_side(
            [
                image_of(batch.left),
                disparity_picture(truth, max(nearest, 1.0)),
                disparity_picture(disparity, max(nearest, 1.0)),
                error_picture(disparity - truth, 1.0),
            ]
        )


class RegressorTask(_DisparityTask):
    """`regressor`: the objective of the preset."""

    def __init__(self, preset: RegressorPreset, network: Regressor, steps: int, seed: int) -> None:
        """As `StereoTask`, with the network to train."""
        super().__init__(preset, steps, seed)
        self.network = network
        self.objective = preset.objective

    def loss(self, batch: StereoBatch) -> Tensor:
        """The objective of a batch at this point of the run."""
        output = self.network(batch.left, batch.right)
        return self.objective(output, batch.disparity, self.global_step / self.steps)


class FineTuningTask(_DisparityTask):
    """`regressor_f`: eq. 9 on the disparity at full resolution."""

    def __init__(self, preset: FineTuningPreset, network: Regressor, steps: int, seed: int) -> None:
        """As `StereoTask`, with the network to train."""
        super().__init__(preset, steps, seed)
        self.network = network
        self.gradient_weight = preset.gradient_weight

    def loss(self, batch: StereoBatch) -> Tensor:
        """`gradient_aware_l1` of a batch."""
        prediction = regress(self.network, batch.left, batch.right).disparity
        return gradient_aware_l1(prediction, batch.disparity, self.gradient_weight)

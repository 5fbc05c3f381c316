"""Training a regressor: from scratch with its own objective, and fine-tuning with eq. 9."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Self

import torch
from torch import Tensor, nn

from stereoforge_kit.viewing import Picture, disparity_picture, error_picture, side_by_side
from training.data.batch import StereoBatch
from training.errors import TrainingError
from training.losses import gradient_aware_l1
from training.metrics import bad_pixel_rate, end_point_error, forward_gradient, gradient_error
from training.networks import Regressor
from training.networks.inference import estimate
from training.preset_kinds import DisparityPreset, FineTuningPreset, RegressorPreset
from training.tasks.base import StereoTask, image_of, map_of

SMOOTH_WITHIN_PX = 1.0
"""Gradient errors are reported where no true forward difference is above this."""


class _DisparityTask(StereoTask):
    monitor = "validation/epe"
    network: Regressor

    def __init__(self, preset: DisparityPreset, network: Regressor, steps: int, seed: int) -> None:
        """As `StereoTask`, with the network to train, parts of which may be frozen.

        Raises:
            TrainingError: the network has no such part, or no other.
        """
        super().__init__(preset, steps, seed)
        self.network = network
        self.frozen = _parts_to_freeze(network, preset.frozen)
        for part in self.frozen:
            part.requires_grad_(False).eval()

    def train(self, mode: bool = True) -> Self:
        """Switch the network to training or evaluation mode; frozen parts stay in evaluation mode."""
        super().train(mode)
        for part in self.frozen:
            part.eval()  # frozen means their BatchNorm statistics too
        return self

    def decayed_parameters(self) -> Iterable[nn.Parameter]:
        """Those that the network names and that are trained."""
        return (p for p in self.network.decayed_parameters() if p.requires_grad)

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
        """As `_DisparityTask`."""
        super().__init__(preset, network, steps, seed)
        self.objective = preset.objective

    def loss(self, batch: StereoBatch) -> Tensor:
        """The objective of a batch at this point of the run."""
        output = self.network(batch.left, batch.right)
        return self.objective(output, batch.disparity, self.global_step / self.steps)


class FineTuningTask(_DisparityTask):
    """`regressor_f`: eq. 9 on the disparity at full resolution."""

    def __init__(self, preset: FineTuningPreset, network: Regressor, steps: int, seed: int) -> None:
        """As `_DisparityTask`."""
        super().__init__(preset, network, steps, seed)
        self.gradient_weight = preset.gradient_weight

    def loss(self, batch: StereoBatch) -> Tensor:
        """`gradient_aware_l1` of a batch."""
        prediction = self.network.regress(batch.left, batch.right).disparity
        return gradient_aware_l1(prediction, batch.disparity, self.gradient_weight)


def _parts_to_freeze(network: Regressor, names: Sequence[str]) -> tuple[nn.Module, ...]:
    """The parts of a network with these names."""
    parts = {name: part for name, part in network.named_children() if any(True for _ in part.parameters())}
    for name in names:
        if name not in parts:
            raise TrainingError(f"{network.title} has no part {name!r} to freeze; it has {', '.join(parts)}")
    if names and set(names) == set(parts):
        raise TrainingError(f"with all parts of {network.title} frozen, there is nothing to train")
    return tuple(parts[name] for name in names)

"""Training ConfNet and GradNet on a frozen regressor."""

from __future__ import annotations

from typing import Self

import torch
from torch import Tensor

from training.data.batch import StereoBatch
from training.networks import ConfNet, GradNet, Regressor
from training.networks.inference import crop_inputs, estimate
from training.preset_kinds import ConfNetPreset, GradNetPreset, Preset
from training.tasks.base import StereoTask
from training.tasks.head_objectives import ConfidenceTask, GradientTask


class HeadTask(StereoTask):
    """Training of heads on a frozen regressor."""

    def __init__(self, preset: Preset, regressor: Regressor, steps: int, seed: int) -> None:
        """As `StereoTask`, with the regressor, whose parameters are frozen."""
        super().__init__(preset, steps, seed)
        self.regressor = regressor.requires_grad_(False).eval()

    def train(self, mode: bool = True) -> Self:
        """Switch the heads to training or evaluation mode; the regressor stays in evaluation mode."""
        super().train(mode)
        self.regressor.eval()  # frozen means its BatchNorm statistics too
        return self


class ConfNetTask(HeadTask, ConfidenceTask):
    """`confnet`: ConfNet on the regressor's disparity and features."""

    def __init__(
        self, preset: ConfNetPreset, regressor: Regressor, network: ConfNet, steps: int, seed: int
    ) -> None:
        """As `HeadTask`, with the network to train."""
        super().__init__(preset, regressor, steps, seed)
        self.network = network
        self.correct_within_px = preset.correct_within_px
        self.enlarged_share = preset.enlarged_share

    def head_inputs(self, batch: StereoBatch) -> tuple[tuple[Tensor, ...], Tensor]:
        """The network's inputs for a batch of crops, and the regressor's disparity."""
        with torch.no_grad():
            seen = crop_inputs(
                self.regressor, self.network, None, batch.left, batch.right, self.enlarged_share
            )
        return seen.confnet, seen.regression.disparity

    def predict(self, batch: StereoBatch) -> tuple[Tensor, Tensor]:
        """Disparity and confidence of a frame of any size."""
        disparity, confidence, _ = estimate(self.regressor, self.kept_network, None, batch.left, batch.right)
        assert confidence is not None
        return disparity, confidence


class GradNetTask(HeadTask, GradientTask):
    """`gradnet`: GradNet on the regressor's disparity and features."""

    initial = "regressor"

    def __init__(
        self, preset: GradNetPreset, regressor: Regressor, network: GradNet, steps: int, seed: int
    ) -> None:
        """As `HeadTask`, with the network to train."""
        super().__init__(preset, regressor, steps, seed)
        self.network = network
        self.threshold_px = preset.gradient_threshold_px
        self.enlarged_share = preset.enlarged_share

    def head_inputs(self, batch: StereoBatch) -> tuple[tuple[Tensor, ...], Tensor]:
        """The network's inputs for a batch of crops, and the regressor's disparity."""
        with torch.no_grad():
            seen = crop_inputs(
                self.regressor, None, self.network, batch.left, batch.right, self.enlarged_share
            )
        return seen.gradnet, seen.regression.disparity

    def predict(self, batch: StereoBatch) -> tuple[Tensor, Tensor]:
        """Disparity and gradient of a frame of any size."""
        disparity, _, gradient = estimate(self.regressor, None, self.kept_network, batch.left, batch.right)
        assert gradient is not None
        return disparity, gradient

"""Training the regressor-free ConfNet and GradNet on the disparity of semi-global matching (ours)."""

from __future__ import annotations

import torch
from torch import Tensor

from training.data.batch import StereoBatch
from training.networks import ConfNet, GradNet
from training.networks.cost_features import CostFeatures
from training.networks.regressor_free import match_batch
from training.presets import RegressorFreeConfNetPreset, RegressorFreeGradNetPreset
from training.tasks.head_objectives import ConfidenceTask, GradientTask


class RegressorFreeConfNetTask(ConfidenceTask):
    """`confnet_free`: ConfNet on disparities that are matched during the run."""

    def __init__(self, preset: RegressorFreeConfNetPreset, network: ConfNet, steps: int, seed: int) -> None:
        """As `StereoTask`, with the network to train."""
        super().__init__(preset, steps, seed)
        self.network = network
        self.correct_within_px = preset.correct_within_px
        self.matcher = preset.matcher

    def head_inputs(self, batch: StereoBatch) -> tuple[tuple[Tensor, ...], Tensor]:
        """The network's inputs for a batch, and the matched disparity with its holes filled."""
        with torch.no_grad():
            left, right = batch.left, batch.right
            matched = match_batch(left, right, self.matcher)
            cost_features = CostFeatures(left, right, matched.disparity)
            inputs = self.network.inputs(matched.features, matched.consistency, cost_features)
        return inputs, matched.disparity

    def predict(self, batch: StereoBatch) -> tuple[Tensor, Tensor]:
        """Matched disparity and confidence of a frame."""
        inputs, disparity = self.head_inputs(batch)
        return disparity, self.kept_network.confidence(*inputs)


class RegressorFreeGradNetTask(GradientTask):
    """`gradnet_free`: GradNet on disparities that are matched during the run."""

    initial = "matched"

    def __init__(self, preset: RegressorFreeGradNetPreset, network: GradNet, steps: int, seed: int) -> None:
        """As `StereoTask`, with the network to train."""
        super().__init__(preset, steps, seed)
        self.network = network
        self.threshold_px = preset.gradient_threshold_px
        self.matcher = preset.matcher

    def head_inputs(self, batch: StereoBatch) -> tuple[tuple[Tensor, ...], Tensor]:
        """The network's inputs for a batch, and the matched disparity with its holes filled."""
        with torch.no_grad():
            left, right = batch.left, batch.right
            matched = match_batch(left, right, self.matcher)
            inputs = self.network.inputs(matched.features, CostFeatures(left, right, matched.disparity))
        return inputs, matched.disparity

    def predict(self, batch: StereoBatch) -> tuple[Tensor, Tensor]:
        """Matched disparity and gradient of a frame."""
        inputs, disparity = self.head_inputs(batch)
        return disparity, self.kept_network(*inputs)

"""Training the regressor-free ConfNet and GradNet on disparities of semi-global matching and of a regressor (ours)."""

from __future__ import annotations

from typing import Self

import torch
from torch import Tensor

from stereoforge_kit.matching import SGBMParameters
from training.data.batch import StereoBatch
from training.networks import ConfNet, GradNet, Regressor, left_right_consistency
from training.networks.cost_features import CostFeatures
from training.networks.regressor_free import RegressorFreeInputs, match_batch
from training.networks.regressors.interface import with_mirrored
from training.preset_kinds import Preset, RegressorFreeConfNetPreset, RegressorFreeGradNetPreset
from training.tasks.base import StereoTask
from training.tasks.head_objectives import ConfidenceTask, GradientTask


class RegressorFreeTask(StereoTask):
    """Training of a head on disparities that are made during the run.

    Semi-global matching makes them or, where there is a regressor, those of half of the crops; the others are the
    regressor's. Matching errs in specks and holes, networks in smooth patches, and the head shall know both. Frames are
    validated on matching.
    """

    matcher: SGBMParameters

    def __init__(self, preset: Preset, regressor: Regressor | None, steps: int, seed: int) -> None:
        """As `StereoTask`, with the regressor, whose parameters are frozen."""
        super().__init__(preset, steps, seed)
        self.regressor = None if regressor is None else regressor.requires_grad_(False).eval()

    def train(self, mode: bool = True) -> Self:
        """Switch the head to training or evaluation mode; the regressor stays in evaluation mode."""
        super().train(mode)
        if self.regressor is not None:
            self.regressor.eval()
        return self

    @torch.no_grad()
    def initial_disparities(self, batch: StereoBatch) -> RegressorFreeInputs:
        """The disparities of a batch of crops that the head judges."""
        matched = len(batch.left) if self.regressor is None else -(-len(batch.left) // 2)
        inputs = match_batch(batch.left[:matched], batch.right[:matched], self.matcher)
        if self.regressor is None or matched == len(batch.left):
            return inputs
        predicted = predict_batch(self.regressor, batch.left[matched:], batch.right[matched:])
        return RegressorFreeInputs(*(torch.cat(maps) for maps in zip(inputs, predicted, strict=True)))


def predict_batch(regressor: Regressor, left: Tensor, right: Tensor) -> RegressorFreeInputs:
    """A regressor's disparity of crops, as if it were anybody's: without holes, and both views alike.

    Args:
        regressor: The network.
        left, right: (B, 3, H, W) in 0..1, H and W multiples of its stride.
    """
    one, mirrored = regressor.regress(*with_mirrored(left, right)).disparity.float().chunk(2)
    return RegressorFreeInputs(one, torch.ones_like(one), left_right_consistency(one, mirrored.flip(-1)))


class RegressorFreeConfNetTask(RegressorFreeTask, ConfidenceTask):
    """`confnet_free`: ConfNet on disparities that are made during the run."""

    def __init__(
        self,
        preset: RegressorFreeConfNetPreset,
        regressor: Regressor | None,
        network: ConfNet,
        steps: int,
        seed: int,
    ) -> None:
        """As `RegressorFreeTask`, with the network to train."""
        super().__init__(preset, regressor, steps, seed)
        self.network = network
        self.correct_within_px = preset.correct_within_px
        self.matcher = preset.matcher

    def head_inputs(self, batch: StereoBatch) -> tuple[tuple[Tensor, ...], Tensor]:
        """The network's inputs for a batch, and the disparity that it judges, with its holes filled."""
        with torch.no_grad():
            initial = self.initial_disparities(batch)
            cost_features = CostFeatures(batch.left, batch.right, initial.disparity)
            inputs = self.network.inputs(initial.features, initial.consistency, cost_features)
        return inputs, initial.disparity

    def predict(self, batch: StereoBatch) -> tuple[Tensor, Tensor]:
        """Matched disparity and confidence of a frame."""
        inputs, disparity = self.head_inputs(batch)
        return disparity, self.kept_network.confidence(*inputs)


class RegressorFreeGradNetTask(RegressorFreeTask, GradientTask):
    """`gradnet_free`: GradNet on disparities that are made during the run."""

    initial = "matched"

    def __init__(
        self,
        preset: RegressorFreeGradNetPreset,
        regressor: Regressor | None,
        network: GradNet,
        steps: int,
        seed: int,
    ) -> None:
        """As `RegressorFreeTask`, with the network to train."""
        super().__init__(preset, regressor, steps, seed)
        self.network = network
        self.threshold_px = preset.gradient_threshold_px
        self.matcher = preset.matcher

    def head_inputs(self, batch: StereoBatch) -> tuple[tuple[Tensor, ...], Tensor]:
        """The network's inputs for a batch, and the disparity that it judges, with its holes filled."""
        with torch.no_grad():
            initial = self.initial_disparities(batch)
            cost_features = CostFeatures(batch.left, batch.right, initial.disparity)
            inputs = self.network.inputs(initial.features, cost_features)
        return inputs, initial.disparity

    def predict(self, batch: StereoBatch) -> tuple[Tensor, Tensor]:
        """Matched disparity and gradient of a frame."""
        inputs, disparity = self.head_inputs(batch)
        return disparity, self.kept_network(*inputs)

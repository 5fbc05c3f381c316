"""Training ConfNet and GradNet on the disparity of semi-global matching, without a regressor."""

from __future__ import annotations

import torch
from torch import Tensor

from training.data import Batch
from training.free import match_batch
from training.losses import confidence_cross_entropy, masked_gradient_l1
from training.metrics import (
    bad_rate,
    forward_differences,
    gradient_error,
    optimal_auc,
    sparsification_auc,
)
from training.networks import ConfNet, GradNet
from training.networks.evidence import Evidence
from training.presets import FreeConfNetPreset, FreeGradNetPreset
from training.tasks.base import StereoTask, image_of, map_of
from viewing import Picture, confidence_picture, error_picture, gradient_picture, side_by_side


class FreeConfNetTask(StereoTask):
    """`confnet_free`: cross-entropy of "correct within t", of disparities that are matched as the run goes."""

    monitor = "validation/auc"
    network: ConfNet

    def __init__(self, preset: FreeConfNetPreset, network: ConfNet, steps: int, seed: int) -> None:
        super().__init__(preset, steps, seed)
        self.network = network
        self.correct_within_px = preset.correct_within_px
        self.matcher = preset.matcher

    def head_inputs(self, batch: Batch) -> tuple[tuple[Tensor, ...], Tensor]:
        """What the network sees, and the disparity it is about."""
        with torch.no_grad():
            left, right = batch["left"], batch["right"]
            matched = match_batch(left, right, self.matcher)
            evidence = Evidence(left, right, matched.disparity)
            inputs = self.network.inputs(matched.features, matched.consistency, evidence)
        return inputs, matched.disparity

    def loss(self, batch: Batch) -> Tensor:
        inputs, disparity = self.head_inputs(batch)
        return confidence_cross_entropy(
            self.network(*inputs), disparity, batch["disparity"], self.correct_within_px
        )

    @torch.no_grad()
    def validate_frame(self, batch: Batch) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        inputs, disparity = self.head_inputs(batch)
        confidence = self.kept_network.confidence(*inputs)
        truth, threshold = batch["disparity"], self.correct_within_px
        rate = bad_rate(disparity, truth, threshold)
        figures = {
            "auc": sparsification_auc(confidence, disparity, truth, threshold),
            "auc_random": rate,
            "auc_optimal": optimal_auc(rate),
        }
        return figures, {"disparity": disparity, "confidence": confidence}

    def panel(self, batch: Batch, maps: dict[str, Tensor]) -> Picture:
        error = map_of(maps["disparity"] - batch["disparity"])
        return side_by_side(
            [
                image_of(batch["left"]),
                error_picture(error, self.correct_within_px),
                confidence_picture(map_of(maps["confidence"])),
            ]
        )


class FreeGradNetTask(StereoTask):
    """`gradnet_free`: masked L1 on the truth's forward differences, from disparities matched as the run goes."""

    monitor = "validation/gradient"
    network: GradNet

    def __init__(self, preset: FreeGradNetPreset, network: GradNet, steps: int, seed: int) -> None:
        super().__init__(preset, steps, seed)
        self.network = network
        self.threshold_px = preset.gradient_threshold_px
        self.matcher = preset.matcher

    def head_inputs(self, batch: Batch) -> tuple[tuple[Tensor, ...], Tensor]:
        """What the network sees, and the disparity it is about."""
        with torch.no_grad():
            left, right = batch["left"], batch["right"]
            matched = match_batch(left, right, self.matcher)
            inputs = self.network.inputs(matched.features, Evidence(left, right, matched.disparity))
        return inputs, matched.disparity

    def loss(self, batch: Batch) -> Tensor:
        inputs, _ = self.head_inputs(batch)
        return masked_gradient_l1(self.network(*inputs), batch["gradient"], self.threshold_px)

    @torch.no_grad()
    def validate_frame(self, batch: Batch) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        inputs, disparity = self.head_inputs(batch)
        gradient, matched = self.kept_network(*inputs), forward_differences(disparity)
        figures = {
            "gradient": gradient_error(gradient, batch["gradient"], self.threshold_px),
            "gradient_matched": gradient_error(matched, batch["gradient"], self.threshold_px),
        }
        return figures, {"gradient": gradient, "matched": matched}

    def panel(self, batch: Batch, maps: dict[str, Tensor]) -> Picture:
        gradients = (batch["gradient"], maps["gradient"], maps["matched"])
        return side_by_side([image_of(batch["left"]), *(gradient_picture(map_of(g)) for g in gradients)])

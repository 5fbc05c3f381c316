"""What ConfNet and GradNet learn, whatever the disparity comes from."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import torch
from torch import Tensor

from refine.metrics import optimal_auc
from stereoforge_kit.viewing import (
    Picture,
    confidence_picture,
    error_picture,
    gradient_picture,
    side_by_side,
)
from training.data.batch import StereoBatch
from training.losses import confidence_cross_entropy, masked_gradient_l1
from training.metrics import bad_pixel_rate, forward_gradient, gradient_error, sparsification_auc
from training.networks import ConfNet, GradNet
from training.tasks.base import StereoTask, image_of, map_of


class DisparityTask(StereoTask):
    """A network that learns something about a disparity it is given."""

    @abstractmethod
    def head_inputs(self, batch: StereoBatch) -> tuple[tuple[Tensor, ...], Tensor]:
        """What the network sees of training crops, and the disparity it is about."""

    @abstractmethod
    def predict(self, batch: StereoBatch) -> tuple[Tensor, Tensor]:
        """The disparity, and what the kept network says of it, of a frame of any size."""


class ConfidenceTask(DisparityTask):
    """Cross-entropy of "correct within t" (section 3.2 of the paper)."""

    monitor = "validation/auc"
    network: ConfNet
    correct_within_px: float

    def loss(self, batch: StereoBatch) -> Tensor:
        inputs, disparity = self.head_inputs(batch)
        return confidence_cross_entropy(
            self.network(*inputs), disparity, batch.disparity, self.correct_within_px
        )

    @torch.no_grad()
    def validate_frame(self, batch: StereoBatch) -> tuple[dict[str, float], dict[str, Tensor]]:
        disparity, confidence = self.predict(batch)
        truth, threshold = batch.disparity, self.correct_within_px
        rate = bad_pixel_rate(disparity, truth, threshold)
        figures = {
            "auc": sparsification_auc(confidence, disparity, truth, threshold),
            "auc_random": rate,
            "auc_optimal": optimal_auc(rate),
        }
        return figures, {"disparity": disparity, "confidence": confidence}

    def panel(self, batch: StereoBatch, maps: dict[str, Tensor]) -> Picture:
        error = map_of(maps["disparity"] - batch.disparity)
        return side_by_side(
            [
                image_of(batch.left),
                error_picture(error, self.correct_within_px),
                confidence_picture(map_of(maps["confidence"])),
            ]
        )


class GradientTask(DisparityTask):
    """Masked L1 on the disparity's forward differences (section 3.3 of the paper)."""

    monitor = "validation/gradient"
    network: GradNet
    threshold_px: float
    initial: ClassVar[str]
    """What the disparity comes from, whose own gradients are the ones to do better than."""

    def loss(self, batch: StereoBatch) -> Tensor:
        inputs, _ = self.head_inputs(batch)
        return masked_gradient_l1(self.network(*inputs), batch.gradient, self.threshold_px)

    @torch.no_grad()
    def validate_frame(self, batch: StereoBatch) -> tuple[dict[str, float], dict[str, Tensor]]:
        disparity, gradient = self.predict(batch)
        own = forward_gradient(disparity)
        figures = {
            "gradient": gradient_error(gradient, batch.gradient, self.threshold_px),
            f"gradient_{self.initial}": gradient_error(own, batch.gradient, self.threshold_px),
        }
        return figures, {"gradient": gradient, "own": own}

    def panel(self, batch: StereoBatch, maps: dict[str, Tensor]) -> Picture:
        gradients = (batch.gradient, maps["gradient"], maps["own"])
        return side_by_side([image_of(batch.left), *(gradient_picture(map_of(g)) for g in gradients)])

"""Head objectives: what ConfNet and GradNet are trained for, wherever the disparity comes from."""

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
    """Training of a head that judges a given disparity."""

    @abstractmethod
    def head_inputs(self, batch: StereoBatch) -> tuple[tuple[Tensor, ...], Tensor]:
        """The network's inputs for a batch of crops, and the disparity (B, 1, H, W) px that it judges."""

    @abstractmethod
    def predict(self, batch: StereoBatch) -> tuple[Tensor, Tensor]:
        """The disparity of a frame of any size, (B, 1, H, W) px, and the kept network's output for it."""


class ConfidenceTask(DisparityTask):
    """ConfNet's objective: cross-entropy of "correct within t" (section 3.2 of the paper)."""

    monitor = "validation/auc"
    network: ConfNet
    """The network that is trained."""
    correct_within_px: float
    """t in pixels."""

    def loss(self, batch: StereoBatch) -> Tensor:
        """`confidence_cross_entropy` of a batch."""
        inputs, disparity = self.head_inputs(batch)
        return confidence_cross_entropy(
            self.network(*inputs), disparity, batch.disparity, self.correct_within_px
        )

    @torch.no_grad()
    def validate_frame(self, batch: StereoBatch) -> tuple[dict[str, float], dict[str, Tensor]]:
        """The sparsification areas of the confidence, of a random order and of the optimal one."""
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
        """Image, disparity error and confidence."""
        error = map_of(maps["disparity"] - batch.disparity)
        return side_by_side(
            [
                image_of(batch.left),
                error_picture(error, self.correct_within_px),
                confidence_picture(map_of(maps["confidence"])),
            ]
        )


class GradientTask(DisparityTask):
    """GradNet's objective: masked L1 of the disparity's forward differences (section 3.3 of the paper)."""

    monitor = "validation/gradient"
    network: GradNet
    """The network that is trained."""
    threshold_px: float
    """Pixels with larger true differences are discontinuities and left out."""
    initial: ClassVar[str]
    """Where the disparity comes from; names the figure of its own gradients, which GradNet should beat."""

    def loss(self, batch: StereoBatch) -> Tensor:
        """`masked_gradient_l1` of a batch."""
        inputs, _ = self.head_inputs(batch)
        return masked_gradient_l1(self.network(*inputs), batch.gradient, self.threshold_px)

    @torch.no_grad()
    def validate_frame(self, batch: StereoBatch) -> tuple[dict[str, float], dict[str, Tensor]]:
        """The gradient errors of the network and of the disparity itself."""
        disparity, gradient = self.predict(batch)
        own = forward_gradient(disparity)
        figures = {
            "gradient": gradient_error(gradient, batch.gradient, self.threshold_px),
            f"gradient_{self.initial}": gradient_error(own, batch.gradient, self.threshold_px),
        }
        return figures, {"gradient": gradient, "own": own}

    def panel(self, batch: StereoBatch, maps: dict[str, Tensor]) -> Picture:
        """Image, true gradient, the network's gradient and the disparity's own."""
        gradients = (batch.gradient, maps["gradient"], maps["own"])
        return side_by_side([image_of(batch.left), *(gradient_picture(map_of(g)) for g in gradients)])

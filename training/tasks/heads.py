"""Training ConfNet and GradNet on a frozen regressor."""

from __future__ import annotations

from typing import Self

import torch
from torch import Tensor

from training.data import Batch
from training.inference import estimate, head_inputs
from training.losses import confidence_cross_entropy, masked_gradient_l1
from training.metrics import (
    bad_rate,
    forward_differences,
    gradient_error,
    optimal_auc,
    sparsification_auc,
)
from training.networks import ConfNet, DispNetCorr1D, GradNet
from training.presets import ConfNetPreset, GradNetPreset, Preset
from training.tasks.base import StereoTask, image_of, map_of
from viewing import Picture, confidence_picture, error_picture, gradient_picture, side_by_side


class HeadTask(StereoTask):
    """Networks on a frozen regressor."""

    def __init__(self, preset: Preset, regressor: DispNetCorr1D, steps: int, seed: int) -> None:
        super().__init__(preset, steps, seed)
        self.regressor = regressor.requires_grad_(False).eval()

    def train(self, mode: bool = True) -> Self:
        super().train(mode)
        self.regressor.eval()  # frozen means its BatchNorm statistics too
        return self


class ConfNetTask(HeadTask):
    """Cross-entropy of "correct within t" (section 3.2 of the paper)."""

    monitor = "validation/auc"
    network: ConfNet

    def __init__(
        self, preset: ConfNetPreset, regressor: DispNetCorr1D, network: ConfNet, steps: int, seed: int
    ) -> None:
        super().__init__(preset, regressor, steps, seed)
        self.network = network
        self.correct_within_px = preset.correct_within_px

    def head_inputs(self, batch: Batch) -> tuple[tuple[Tensor, ...], Tensor]:
        """What the network sees, from the regressor run once; and the disparity it is about."""
        with torch.no_grad():
            seen = head_inputs(self.regressor, self.network, None, batch["left"], batch["right"])
        return seen.confnet, seen.regression.disparity

    def loss(self, batch: Batch) -> Tensor:
        inputs, disparity = self.head_inputs(batch)
        return confidence_cross_entropy(
            self.network(*inputs), disparity, batch["disparity"], self.correct_within_px
        )

    def validate_frame(self, batch: Batch) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        disparity, confidence, _ = estimate(
            self.regressor, self.kept_network, None, batch["left"], batch["right"]
        )
        assert confidence is not None
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


class GradNetTask(HeadTask):
    """Masked L1 on the disparity's forward differences (section 3.3 of the paper)."""

    monitor = "validation/gradient"
    network: GradNet

    def __init__(
        self, preset: GradNetPreset, regressor: DispNetCorr1D, network: GradNet, steps: int, seed: int
    ) -> None:
        super().__init__(preset, regressor, steps, seed)
        self.network = network
        self.threshold_px = preset.gradient_threshold_px

    def head_inputs(self, batch: Batch) -> tuple[tuple[Tensor, ...], Tensor]:
        """What the network sees, from the regressor run once; and the disparity it is about."""
        with torch.no_grad():
            seen = head_inputs(self.regressor, None, self.network, batch["left"], batch["right"])
        return seen.gradnet, seen.regression.disparity

    def loss(self, batch: Batch) -> Tensor:
        inputs, _ = self.head_inputs(batch)
        return masked_gradient_l1(self.network(*inputs), batch["gradient"], self.threshold_px)

    def validate_frame(self, batch: Batch) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        disparity, _, gradient = estimate(
            self.regressor, None, self.kept_network, batch["left"], batch["right"]
        )
        assert gradient is not None
        regressed = forward_differences(disparity)
        figures = {
            "gradient": gradient_error(gradient, batch["gradient"], self.threshold_px),
            "gradient_regressor": gradient_error(regressed, batch["gradient"], self.threshold_px),
        }
        return figures, {"gradient": gradient, "regressed": regressed}

    def panel(self, batch: Batch, maps: dict[str, Tensor]) -> Picture:
        gradients = (batch["gradient"], maps["gradient"], maps["regressed"])
        return side_by_side([image_of(batch["left"]), *(gradient_picture(map_of(g)) for g in gradients)])

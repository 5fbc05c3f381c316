"""Training ConfNet and GradNet through the refinement, on the error of the refined disparity (ours)."""

from __future__ import annotations

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from refine.methods.ours import Ours
from refine.mrf.torch.differentiable import image_weights, refine_batch
from stereoforge_kit.viewing import (
    Picture,
    confidence_picture,
    disparity_picture,
    error_picture,
    gradient_picture,
    side_by_side,
)
from training.data.batch import StereoBatch
from training.losses import confidence_cross_entropy, masked_gradient_l1, refinement_l1
from training.metrics import (
    bad_pixel_rate,
    end_point_error,
    forward_gradient,
    gradient_error,
    sparsification_auc,
)
from training.networks import ConfNet, GradNet, Regressor
from training.networks.inference import HeadInputs, estimate, head_inputs
from training.preset_kinds import JointPreset
from training.tasks.base import image_of, map_of
from training.tasks.heads import HeadTask


class JointHeads(nn.Module):
    """ConfNet and GradNet as one network."""

    def __init__(self, confnet: ConfNet, gradnet: GradNet) -> None:
        """Keep both networks."""
        super().__init__()
        self.confnet = confnet
        self.gradnet = gradnet


class JointTask(HeadTask):
    """`joint`: the heads' own losses plus L1 of the refined disparity and of its gradient.

    The regressor is frozen. The refinement is solved to the preset's tolerance, and its derivative comes from the
    implicit function theorem. So ConfNet learns where the disparity does harm, and GradNet which gradients help.
    """

    monitor = "validation/refined_epe"
    network: JointHeads
    """The two networks that are trained."""

    def __init__(
        self,
        preset: JointPreset,
        regressor: Regressor,
        network: JointHeads,
        refinement: Ours,
        steps: int,
        seed: int,
    ) -> None:
        """As `HeadTask`, with the networks to train and the refinement to train them through."""
        super().__init__(preset, regressor, steps, seed)
        self.network = network
        self.refinement = refinement
        self.losses = preset

    def inputs(self, batch: StereoBatch) -> HeadInputs:
        """The inputs of both networks for a batch of crops; the regressor runs once."""
        heads = self.network
        with torch.no_grad():
            return head_inputs(self.regressor, heads.confnet, heads.gradnet, batch.left, batch.right)

    def refine(self, image: Tensor, disparity: Tensor, logits: Tensor, gradient: Tensor) -> Tensor:
        """Refine a disparity, differentiably in the networks' outputs.

        Args:
            image: (B, 3, H, W) in 0..1.
            disparity: (B, 1, H, W) px.
            logits: (B, 2, H, W), ConfNet's.
            gradient: (B, 2, H, W) px per px, GradNet's.

        Returns:
            (B, 1, H, W) px.
        """
        shape = self.refinement.shape
        # `ConfidenceShape.apply` of softmax(logits)[1], computed in logarithms to keep its digits.
        log_confidence = F.logsigmoid((logits[:, 1] - logits[:, 0]) / shape.temperature)
        return refine_batch(
            disparity[:, 0],
            torch.exp(shape.power * log_confidence),
            gradient,
            image_weights(image * 255, self.refinement.parameters.sigma_r),
            self.refinement.parameters,
            self.refinement.form,
            self.losses.tolerance,
        )[:, None]

    def loss(self, batch: StereoBatch) -> Tensor:
        """The heads' own losses plus the weighted `refinement_l1` of a batch."""
        seen = self.inputs(batch)
        disparity = seen.regression.disparity
        logits, gradient = self.network.confnet(*seen.confnet), self.network.gradnet(*seen.gradnet)
        own = confidence_cross_entropy(
            logits, disparity, batch.disparity, self.losses.correct_within_px
        ) + masked_gradient_l1(gradient, batch.gradient, self.losses.gradient_threshold_px)
        if self.losses.refined_weight == 0:
            return own
        refined = self.refine(batch.left, disparity, logits, gradient)
        through = refinement_l1(
            refined,
            batch.disparity,
            batch.gradient,
            self.losses.refined_gradient_weight,
            self.losses.gradient_threshold_px,
        )
        return own + self.losses.refined_weight * through

    def validate_frame(self, batch: StereoBatch) -> tuple[dict[str, float], dict[str, Tensor]]:
        """Errors of the refined disparity, and the figures of both networks by themselves."""
        heads = self.kept_network
        disparity, confidence, gradient = estimate(
            self.regressor, heads.confnet, heads.gradnet, batch.left, batch.right
        )
        assert confidence is not None
        assert gradient is not None
        solved = self.refinement.solve(
            map_of(disparity), map_of(confidence), map_of(gradient), image_of(batch.left)
        ).disparity
        refined = torch.from_numpy(solved).to(disparity)[None, None]
        truth, threshold = batch.disparity, self.losses.gradient_threshold_px
        figures = {
            "refined_epe": end_point_error(refined, truth),
            "refined_bad1": bad_pixel_rate(refined, truth, 1.0),
            "refined_gradient": gradient_error(forward_gradient(refined), batch.gradient, threshold),
            "gradient": gradient_error(gradient, batch.gradient, threshold),
            "auc": sparsification_auc(confidence, disparity, truth, self.losses.correct_within_px),
        }
        return figures, {"refined": refined, "confidence": confidence, "gradient": gradient}

    def panel(self, batch: StereoBatch, maps: dict[str, Tensor]) -> Picture:
        """Image, refined disparity and its error, confidence and gradient."""
        nearest = max(float(torch.nan_to_num(batch.disparity).max()), 1.0)
        return side_by_side(
            [
                image_of(batch.left),
                disparity_picture(map_of(maps["refined"]), nearest),
                error_picture(map_of(maps["refined"] - batch.disparity), 1.0),
                confidence_picture(map_of(maps["confidence"])),
                gradient_picture(map_of(maps["gradient"])),
            ]
        )

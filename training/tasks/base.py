"""What all tasks share: optimizer, schedule, the random state of a step, and the stop at a loss of NaN."""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar

import numpy as np
import pytorch_lightning as pl
import torch
from torch import Tensor, nn
from torch.nn.modules.batchnorm import _BatchNorm
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from stereoforge_kit.viewing import Picture
from training.data.batch import StereoBatch
from training.errors import TrainingError
from training.preset_kinds import OptimizerConfig, Preset

STATISTICS_BATCHES = 200
"""Batches over which BatchNorm's statistics are measured before they are fixed. Over 100 batches, two measurements
gave end-point errors of the same weights that differed by 4 %."""
PANELS = 3
"""Number of validation frames shown in TensorBoard."""


def learning_rate_factor(config: OptimizerConfig, step: int, steps: int, preset_steps: int) -> float:
    """The learning rate at a step, relative to `config.learning_rate`.

    Args:
        config: The schedule, in steps of the preset.
        step: Number of the step, from 0.
        steps: Steps of the run.
        preset_steps: Steps of the preset; the schedule is scaled from these to `steps`.
    """
    position = step * preset_steps / steps
    if config.schedule == "halving":
        factor = 0.5 ** sum(position >= halving for halving in config.halve_at)
    else:
        factor = 0.5 * (1 + math.cos(math.pi * min(position / preset_steps, 1.0)))
    if position < config.warmup_steps:
        factor *= (position + preset_steps / steps) / (config.warmup_steps + preset_steps / steps)
    return factor


class StereoTask(pl.LightningModule):
    """A network in training."""

    monitor: ClassVar[str]
    """The validation figure whose smallest value marks the best weights."""
    network: nn.Module
    """The network that is trained."""

    def __init__(self, preset: Preset, steps: int, seed: int) -> None:
        """Keep the settings.

        Args:
            preset: Optimizer, schedule and losses.
            steps: Optimizer steps of the run.
            seed: Decides the random state of every step.
        """
        super().__init__()
        self.preset = preset
        self.steps = steps
        self.seed = seed
        self.mixed_precision = False
        self._averaged: AveragedModel | None = None

    def average_weights(self, decay: float) -> None:
        """Keep an exponential moving average of the network's weights, and validate and save that from now on."""
        average = get_ema_multi_avg_fn(decay)  # type: ignore[no-untyped-call]
        self._averaged = AveragedModel(self.network, multi_avg_fn=average)
        self._averaged.requires_grad_(False)

    @property
    def kept_network(self) -> Any:
        """The network that is validated and saved: the one trained, or its moving average."""
        return self.network if self._averaged is None else self._averaged.module

    def optimizer_step(self, *arguments: Any, **options: Any) -> None:
        """Change the weights, and with them their moving average, before a checkpoint can be written."""
        super().optimizer_step(*arguments, **options)
        if self._averaged is not None:
            self._averaged.update_parameters(self.network)

    def on_train_start(self) -> None:
        """Take the learning rate from the schedule, which a resumed run may have for more steps than before."""
        for scheduler in self.trainer.lr_scheduler_configs:
            rate = self._learning_rate_factor(scheduler.scheduler.last_epoch)
            for group in scheduler.scheduler.optimizer.param_groups:
                group["lr"] = group["initial_lr"] * rate

    @abstractmethod
    def loss(self, batch: StereoBatch) -> Tensor:
        """The loss of a batch of crops, a scalar."""

    @abstractmethod
    def validate_frame(self, batch: StereoBatch) -> tuple[dict[str, float], dict[str, Tensor]]:
        """Figures of one whole frame, NaN where nothing can be measured, and the maps that its panel shows."""

    @abstractmethod
    def panel(self, batch: StereoBatch, maps: dict[str, Tensor]) -> Picture:
        """The picture of a validation frame for TensorBoard, from its batch and the maps of `validate_frame`."""

    def decayed_parameters(self) -> Iterable[nn.Parameter]:
        """The parameters with weight decay: all that are trained, unless a task overrides this."""
        return (p for p in self.network.parameters() if p.requires_grad)

    def on_train_batch_start(self, batch: StereoBatch, batch_idx: int) -> None:  # noqa: ARG002
        """Set the random state of the step, and fix BatchNorm's statistics towards the end of the run."""
        # Dropout draws from torch's global generator. Its state follows from the step, so that a resumed run equals
        # an uninterrupted one. `train` restores the caller's own state.
        entropy = np.random.SeedSequence([self.seed, 3, self.global_step, self.global_rank])
        torch.manual_seed(int(entropy.generate_state(1, np.uint64)[0]))
        fixed_from = self.steps - round(self.preset.fixed_statistics * self.steps)
        norms = [part for part in self.network.modules() if isinstance(part, _BatchNorm) and part.training]
        if (
            norms and self.global_step == fixed_from > 0
        ):  # from 0, the statistics that came with the network stay
            self._measure_statistics(norms)
        if self.global_step >= fixed_from:
            for norm in norms:
                norm.eval()

    @torch.no_grad()
    def _measure_statistics(self, norms: Sequence[_BatchNorm]) -> None:
        """Give BatchNorm the mean of many batches' statistics.

        Its own are a moving average over the last few batches, with which validation errors fluctuate (Wu and Johnson,
        "Rethinking 'Batch' in BatchNorm", 2021).
        """
        data = self.trainer.datamodule
        interval = self.preset.validation_interval
        first = self.global_step // interval * interval
        batches = data.block(first, self.trainer.global_rank, self.trainer.world_size)
        momenta = [norm.momentum for norm in norms]
        for norm in norms:
            norm.reset_running_stats()
            norm.momentum = None  # to torch this means the mean over all batches
        for batch in itertools.islice(batches, STATISTICS_BATCHES):
            self.loss(self.transfer_batch_to_device(batch, self.device, 0))
        for norm, momentum in zip(norms, momenta, strict=True):
            norm.momentum = momentum

    def training_step(self, batch: StereoBatch, batch_idx: int) -> Tensor:  # noqa: ARG002
        """The loss of a step, which is also logged.

        Raises:
            TrainingError: the loss is not finite.
        """
        loss = self.loss(batch)
        if not torch.isfinite(loss):
            raise TrainingError(
                f"the loss of step {self.global_step} is {loss.item()}, so training stopped; "
                "a smaller learning rate or gradient clipping usually helps"
            )
        self.log("train/loss", loss.detach(), batch_size=len(batch.left), sync_dist=True)
        self.log("train/learning_rate", self.optimizers().param_groups[0]["lr"])
        return loss

    def validation_step(self, batch: StereoBatch, batch_idx: int) -> None:
        """Log the figures of a frame, and the pictures of the first frames."""
        figures, maps = self.validate_frame(batch)
        answered = not any(bool(torch.isnan(each).all()) for each in maps.values())
        for name, value in figures.items():
            # A frame whose ground truth says nothing of a figure does not count; a network without an answer does.
            unknown = answered and math.isnan(value)
            self.log(
                f"validation/{name}",
                0.0 if unknown else value,
                batch_size=0 if unknown else 1,
                on_step=False,
                on_epoch=True,
                sync_dist=True,
            )
        if batch_idx < PANELS and self.logger is not None and self.trainer.is_global_zero:
            picture = self.panel(batch, maps)
            self.logger.experiment.add_image(
                f"frame{batch_idx}", picture, self.global_step, dataformats="HWC"
            )

    def _learning_rate_factor(self, step: int) -> float:
        return learning_rate_factor(self.preset.optimizer, step, self.steps, self.preset.steps)

    def configure_optimizers(self) -> Any:
        """Adam and the schedule of its learning rate, as Lightning takes them."""
        config = self.preset.optimizer
        decayed = list(self.decayed_parameters())
        known = {id(p) for p in decayed}
        undecayed = [p for p in self.network.parameters() if p.requires_grad and id(p) not in known]
        optimizer = torch.optim.Adam(
            [
                {"params": decayed, "weight_decay": config.weight_decay},
                {"params": undecayed, "weight_decay": 0.0},
            ],
            lr=config.learning_rate,
            betas=config.betas,
            eps=config.epsilon,
            # Gradients are clipped between unscaling and the step; a fused optimizer does both at once.
            fused=not self.mixed_precision,
        )
        scheduler = torch.optim.lr_scheduler.LambdaLR(
            optimizer, lambda step: self._learning_rate_factor(step)
        )
        return {"optimizer": optimizer, "lr_scheduler": {"scheduler": scheduler, "interval": "step"}}


def image_of(views: Tensor) -> Picture:
    """The first of a batch of images (B, 3, H, W) in 0..1 as (H, W, 3) uint8."""
    picture: Picture = (views[0].clamp(0, 1) * 255).round().byte().permute(1, 2, 0).cpu().numpy()
    return picture


def map_of(maps: Tensor) -> Any:
    """The first of a batch of maps (B, C, H, W), as (H, W) if C is 1, else (H, W, C)."""
    array = maps[0].float().cpu().numpy()
    return array[0] if len(array) == 1 else array.transpose(1, 2, 0)

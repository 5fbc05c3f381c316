"""Checkpoints of a run: everything needed to continue as if it had not stopped."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch
from pytorch_lightning.callbacks import Checkpoint
from pytorch_lightning.plugins.io import TorchCheckpointIO

from stereoforge_kit.files import replacing
from training.errors import TrainingError
from training.runs.interruption import Interruption

CHECKPOINT_EVERY_S = 300.0
"""At most so many seconds of a run are lost, whatever ends it."""


class WholeCheckpoints(TorchCheckpointIO):
    """Checkpoints that replace the earlier one at once, so that a kill at any moment leaves one of the two.

    They are written beside the target and renamed. Lightning's own are written to the system's temporary folder, from
    where moving to another file system is a copy.
    """

    def save_checkpoint(
        self,
        checkpoint: dict[str, Any],
        path: str | Path,
        storage_options: Any = None,  # noqa: ARG002
    ) -> None:
        """Write a checkpoint to `path`."""
        with replacing(Path(path)) as temporary:
            torch.save(checkpoint, temporary)


class RunCheckpoints(Checkpoint):
    """Writes the run's only checkpoint: after every validation, every few minutes in between, and when interrupted.

    An interruption is heeded after a training step or a validation frame, where a checkpoint can be exact.
    """

    def __init__(self, path: Path, interruption: Interruption) -> None:
        """Keep where to, and what tells of an interruption."""
        self._path = path
        self._interruption = interruption
        self._written_at = time.monotonic()
        self._validation_due = False

    def on_fit_start(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:  # noqa: ARG002
        """Take over the signals, before worker processes inherit their handlers."""
        self._interruption.defer()

    def on_train_start(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        """Validate first if the checkpoint was written before its step's validation ended."""
        self._interruption.defer()  # again, since Lightning has put its own handler before ours
        self._written_at = time.monotonic()
        if self._validation_due:
            _validate(trainer, pl_module)

    def on_train_batch_end(self, trainer: pl.Trainer, *_: Any) -> None:
        """Write a checkpoint where it is time or the run is to stop."""
        late = time.monotonic() - self._written_at >= CHECKPOINT_EVERY_S
        # Processes of one run must agree, whichever of them was interrupted.
        if not _agree(trainer, late or self._interruption.requested):
            return
        if trainer.global_step == trainer.max_steps:
            return  # it ends in a moment
        self._validation_due = trainer.is_last_batch
        if not self._validation_due:
            self._write(trainer)
        self._stop_if_requested(trainer)

    def on_validation_batch_end(self, trainer: pl.Trainer, *_: Any) -> None:
        """Stop a validation, which is begun again after resuming."""
        self._validation_due = True
        self._stop_if_requested(trainer)

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:  # noqa: ARG002
        """Write a checkpoint after the validation."""
        self._validation_due = False
        self._write(trainer)

    def state_dict(self) -> dict[str, Any]:
        """What a checkpoint stores."""
        return {"validation_due": self._validation_due}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Take up what a checkpoint stored."""
        self._validation_due = state_dict["validation_due"]

    def _stop_if_requested(self, trainer: pl.Trainer) -> None:
        if not _agree(trainer, self._interruption.requested):
            return
        # After the last step, Lightning would not come back to validate it.
        if self._validation_due and trainer.global_step < trainer.max_steps:
            self._write(trainer)
        raise KeyboardInterrupt

    def _write(self, trainer: pl.Trainer) -> None:
        trainer.save_checkpoint(self._path)
        self._written_at = time.monotonic()


def checkpoint_step(path: Path) -> int | None:
    """The step that a checkpoint was written after; None where there is none.

    Raises:
        TrainingError: the file is damaged.
    """
    if not path.is_file():
        return None
    try:
        return int(WholeCheckpoints().load_checkpoint(path, weights_only=True)["global_step"])
    except Exception as error:  # torch raises nearly anything for a damaged file
        raise TrainingError(
            f"{path}: cannot be read, so the run cannot be resumed; delete it to start anew"
        ) from error


def _agree(trainer: pl.Trainer, wanted: bool) -> bool:
    """Whether any of the run's processes wants something."""
    return bool(trainer.strategy.reduce_boolean_decision(wanted, all=False))


def _validate(trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
    """What Lightning does after the last step of a block."""
    loop = trainer.fit_loop.epoch_loop
    loop._batches_that_stepped -= 1  # figures are logged under the number of the step, from 0
    trainer.validating = True
    loop.val_loop.run()
    trainer.training = True
    loop._batches_that_stepped += 1
    for callback in trainer.callbacks:
        callback.on_train_epoch_end(trainer, pl_module)

"""Checkpoints of a run: everything needed to continue as if it had not stopped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from pytorch_lightning.callbacks import ModelCheckpoint
from pytorch_lightning.plugins.io import TorchCheckpointIO

from stereoforge_kit.files import replacing


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


def last_checkpoint(path: Path) -> ModelCheckpoint:
    """A callback that writes the run's only checkpoint to `path` after every validation."""
    return ModelCheckpoint(
        dirpath=path.parent,
        filename=path.stem,
        save_top_k=1,
        enable_version_counter=False,
        save_on_train_epoch_end=True,
    )

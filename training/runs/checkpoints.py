"""Checkpoints of a run: everything needed to continue as if it had not stopped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from pytorch_lightning.callbacks import ModelCheckpoint
from pytorch_lightning.plugins.io import TorchCheckpointIO

from stereoforge_kit.files import replacing


class WholeCheckpoints(TorchCheckpointIO):
    """Writes beside the target and renames, so that a kill at any moment leaves the earlier checkpoint or the new one.

    Lightning's own writes to the system's temporary folder first, and moving from there to another file system
    copies.
    """

    def save_checkpoint(
        self,
        checkpoint: dict[str, Any],
        path: str | Path,
        storage_options: Any = None,  # noqa: ARG002
    ) -> None:
        with replacing(Path(path)) as temporary:
            torch.save(checkpoint, temporary)


def last_checkpoint(path: Path) -> ModelCheckpoint:
    """Replaces the one checkpoint of a run after every validation."""
    return ModelCheckpoint(
        dirpath=path.parent,
        filename=path.stem,
        save_top_k=1,
        enable_version_counter=False,
        save_on_train_epoch_end=True,
    )

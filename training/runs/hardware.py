"""What a run computes on: one device, or under torchrun one process per device."""

from __future__ import annotations

import os
from typing import Any, Literal

from pytorch_lightning.strategies import DDPStrategy

from training.devices import parse_device
from training.errors import TrainingError

Precision = Literal["32", "bf16", "16"]
"""Bits of the convolutions; weights, losses and disparities always have 32."""


def process_rank() -> int:
    """The number of this process among torchrun's, from 0; 0 without torchrun."""
    return int(os.environ.get("RANK", "0"))


def process_count() -> int:
    """The number of torchrun's processes; 1 without torchrun."""
    return int(os.environ.get("WORLD_SIZE", "1"))


def trainer_options(device: str, precision: Precision) -> dict[str, Any]:
    """The options of Lightning's trainer for a device, a precision and the processes that torchrun started.

    Args:
        device: As `training.devices.parse_device` takes it.
        precision: Bits of the convolutions.

    Raises:
        TrainingError: a device or a precision that this machine does not have.
    """
    chosen = parse_device(device)
    on_gpu = chosen.type == "cuda"
    if precision == "16" and not on_gpu:
        raise TrainingError("16-bit floats need a GPU; bf16 works on CPUs too")
    options: dict[str, Any] = {
        "accelerator": chosen.type,
        "devices": 1 if chosen.index is None else [chosen.index],
        "precision": "32-true" if precision == "32" else f"{precision}-mixed",
    }
    if process_count() > 1:
        local = int(os.environ["LOCAL_WORLD_SIZE"])
        options |= {
            "devices": local,
            "num_nodes": process_count() // local,
            # The early stages of the loss schedule leave the fine scales without gradients.
            "strategy": DDPStrategy(find_unused_parameters=True),
            # torch has no synchronised BatchNorm on CPUs; there each process normalises by its own crops.
            "sync_batchnorm": on_gpu,
        }
    return options

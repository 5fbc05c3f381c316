"""The names of the devices that networks are trained and run on."""

from __future__ import annotations

import re
from typing import Literal

import torch

from training.errors import TrainingError, UnknownDeviceError

NAMES = "auto, cpu, cuda, cuda:1 (the second GPU) or mps"
"""What a device may be called, for messages and help."""


def parse_device(name: str) -> torch.device:
    """The device of a name, which this machine must have.

    Args:
        name: `auto` (cuda where there is such a GPU, else cpu), `cpu`, `cuda` (the first), `cuda:N` or `mps`.

    Raises:
        UnknownDeviceError: no device has such a name.
        TrainingError: the device is not there.
    """
    found = re.fullmatch(r"(auto|cpu|mps|cuda)|cuda:(\d{1,4})", name)
    if found is None:
        raise UnknownDeviceError(f"there is no device {name!r}; it is called {NAMES}")
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if name == "mps" and not torch.backends.mps.is_available():
        raise TrainingError("cannot compute on mps: torch finds no Apple GPU here; cpu works everywhere")
    if name.startswith("cuda"):
        _require_gpu(name, int(found[2] or 0))
    return torch.device(name)


PredictionPrecision = Literal["auto", "32", "bf16"]
"""Bits of the convolutions in prediction; `auto` is bf16 on processors that multiply it in hardware, else 32."""


def computes_in_bfloat16(precision: PredictionPrecision, device: torch.device) -> bool:
    """Whether networks predict in mixed precision with bfloat16.

    Args:
        precision: What is wanted. `auto` leaves other devices than the CPU at 32 bits, where this was not measured.
        device: What the networks run on.

    Examples:
        >>> computes_in_bfloat16("32", torch.device("cpu")), computes_in_bfloat16("bf16", torch.device("cpu"))
        (False, True)
    """
    if precision != "auto":
        return precision == "bf16"
    able = torch.cpu.get_capabilities() if device.type == "cpu" else {}
    return bool(able.get("avx512_bf16") or able.get("amx_bf16"))


def _require_gpu(name: str, index: int) -> None:
    count = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if not count:
        raise TrainingError(f"cannot compute on {name}: torch finds no GPU here; cpu works everywhere")
    if index >= count:
        there = ", ".join(f"cuda:{number}" for number in range(count))
        raise TrainingError(f"cannot compute on {name}: torch finds {there} here")

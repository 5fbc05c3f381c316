"""The names of the devices that networks are trained and run on."""

from __future__ import annotations

import re

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


def _require_gpu(name: str, index: int) -> None:
    count = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if not count:
        raise TrainingError(f"cannot compute on {name}: torch finds no GPU here; cpu works everywhere")
    if index >= count:
        there = ", ".join(f"cuda:{number}" for number in range(count))
        raise TrainingError(f"cannot compute on {name}: torch finds {there} here")

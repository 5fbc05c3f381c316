"""Which GPU each worker may see: by default one worker for each GPU."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

VISIBLE_DEVICES = {
    "cuda": "CUDA_VISIBLE_DEVICES",
    "optix": "CUDA_VISIBLE_DEVICES",
    "hip": "HIP_VISIBLE_DEVICES",
}
"""The environment variable that limits the GPUs a process sees, by Cycles' name for the device."""
_KFD_NODES = Path("/sys/class/kfd/kfd/topology/nodes")


def assign_devices(
    device: str, gpus: Sequence[str], workers: int | None = None
) -> tuple[Mapping[str, str], ...]:
    """The environment variables of each worker.

    Args:
        device: What Cycles computes on. Devices that no variable tells apart (the CPU, Apple's) give empty mappings.
        gpus: The names of the GPUs as the variable in `VISIBLE_DEVICES` takes them, such as "0" or a UUID.
        workers: How many workers, which are spread over the GPUs evenly; None for one per GPU.
    """
    if device not in VISIBLE_DEVICES or not gpus:
        return ({},) * (workers or 1)
    count = len(gpus) if workers is None else workers
    return tuple({VISIBLE_DEVICES[device]: gpus[index % len(gpus)]} for index in range(count))


def find_gpus(device: str, environment: Mapping[str, str]) -> list[str]:
    """The GPUs that this process may use: those that its environment names, or all that the driver lists."""
    if device not in VISIBLE_DEVICES:
        return []
    named = environment.get(VISIBLE_DEVICES[device])
    if named is not None:
        return [name.strip() for name in named.split(",") if name.strip()]
    count = _count_amd() if device == "hip" else _count_nvidia()
    return [str(index) for index in range(count)]


def _count_nvidia() -> int:
    try:
        listing = subprocess.run(["nvidia-smi", "-L"], capture_output=True, text=True, timeout=30, check=True)
    except (OSError, subprocess.SubprocessError):
        return 0
    return sum(line.startswith("GPU ") for line in listing.stdout.splitlines())


def _count_amd() -> int:
    identifiers = [path.read_text().strip() for path in _KFD_NODES.glob("*/gpu_id")]
    return sum(identifier not in ("", "0") for identifier in identifiers)

"""Limits of time and memory for worker processes."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

_CGROUP_MEMORY_FILES = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


@dataclass(frozen=True)
class Limits:
    """What one call in a worker process may use before the process is ended."""

    timeout_s: float = 1800.0
    """Wall seconds."""
    memory_bytes: int | None = None
    """Resident memory of the process; None for no limit."""


def available_memory_bytes() -> int:
    """The memory of this machine, or of the container this runs in where that has less."""
    sizes = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    for name in _CGROUP_MEMORY_FILES:
        try:
            text = Path(name).read_text().strip()
        except OSError:
            continue
        if text.isdigit():
            sizes.append(int(text))
    return min(sizes)

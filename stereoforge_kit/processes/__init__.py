"""Worker processes with limits, which may crash, hang or run out of memory without harm to their parent."""

from stereoforge_kit.processes.call import call_limited
from stereoforge_kit.processes.limits import Limits, available_memory_bytes
from stereoforge_kit.processes.process import (
    WorkerError,
    WorkerProcess,
    captured_output,
    check_main_guard,
)

__all__ = [
    "Limits",
    "WorkerError",
    "WorkerProcess",
    "available_memory_bytes",
    "call_limited",
    "captured_output",
    "check_main_guard",
]

"""Processes that may crash, hang or eat memory without harm: what runs in them is limited and replaceable."""

from workers.call import call_limited
from workers.limits import Limits, available_memory_bytes
from workers.process import WorkerError, WorkerProcess, captured_output

__all__ = [
    "Limits",
    "WorkerError",
    "WorkerProcess",
    "available_memory_bytes",
    "call_limited",
    "captured_output",
]

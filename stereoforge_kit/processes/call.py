"""One call in a process of its own, for work on untrusted input."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from multiprocessing.connection import wait
from typing import Any, TypeVar

from stereoforge_kit.processes.limits import Limits
from stereoforge_kit.processes.process import POLL_S, WorkerProcess

Result = TypeVar("Result")


def call_limited(
    function: Callable[..., Result],
    args: Sequence[Any] = (),
    *,
    memory_bytes: int | None = 1 << 30,
    timeout_s: float = 60.0,
) -> Result:
    """Return `function(*args)`, computed in a fresh process that may use so much memory (None: all) and time.

    Function, arguments and result travel by pickle between this process and its own child, so the function
    must be importable by its name. What it prints is shown nowhere. Starting the process takes a second.

    Raises what the function raises, and WorkerError, one sentence, if the process crashed or was ended.
    """
    worker = WorkerProcess(Limits(timeout_s, memory_bytes))
    try:
        worker.start(function, *args)
        while not worker.poll():
            wait(worker.waitables, POLL_S)
        return worker.result()
    finally:
        worker.stop()

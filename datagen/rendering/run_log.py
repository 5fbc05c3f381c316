"""The log of a run as JSON lines, `logs/render-<time>-<host>-<pid>.jsonl`. It is no part of the data."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stereoforge_kit.files import LocalTree, Tree

LOGS_FOLDER = "logs"
"""The data set's folder of logs."""


class RunLog:
    """A log with one line for each event. A line is in the file when `write` returns."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def write(self, event: str, **fields: Any) -> None:
        """Add a line: the time (UTC, ISO 8601), the event's name and its fields."""
        line = {"time": datetime.now(UTC).isoformat(timespec="milliseconds"), "event": event, **fields}
        with suppress(OSError):  # A full disk is reported by the run itself; its log must not hide that.
            os.write(self._descriptor, (json.dumps(line) + "\n").encode())


@contextmanager
def run_log(tree: Tree, scratch: Path) -> Iterator[RunLog]:
    """A new log in the data set's `logs`. Behind a URL it is written to `scratch` and uploaded when the run ends."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")
    name = f"{LOGS_FOLDER}/render-{stamp}-{socket.gethostname()}-{os.getpid()}.jsonl"
    path = tree.root / name if isinstance(tree, LocalTree) else scratch / Path(name).name
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        yield RunLog(descriptor)
    finally:
        os.close(descriptor)
        if not isinstance(tree, LocalTree):
            tree.adopt(path, name)

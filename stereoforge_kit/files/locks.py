"""Locks between processes, each a file that the system frees however its holder ends.

Where a file system has no locks, nothing is held and nobody is kept out.
"""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def locked(path: Path, *, shared: bool = False) -> Iterator[None]:
    """Wait for the lock of a file, which is made in an existing folder, and hold it."""
    with path.open("a") as file:
        with suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_SH if shared else fcntl.LOCK_EX)
        yield


@contextmanager
def alone(path: Path, otherwise: Exception | None = None) -> Iterator[None]:
    """Hold the lock of a file, which is made; where another process holds it raise `otherwise` at once, or
    BlockingIOError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            held = BlockingIOError(error.errno, "another process holds the lock", str(path))
            raise otherwise or held from None
        except OSError:
            pass
        yield

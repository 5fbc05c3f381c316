"""What goes wrong in the processes that prepare crops, in the words it would have in this one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from stereoforge_kit.errors import UserError
from training.errors import TrainingError

_WRAPPED = re.compile(r"Caught \w+ in DataLoader worker process \d+\.\n")
_NO_SHARED_MEMORY = re.compile(r"shared memory|Bus error|</torch_\w+>")
_LOST = re.compile(
    r"DataLoader worker \(pid\(?s?\)? [\d, ]+\) (is killed by signal: \w+|exited unexpectedly)"
)


@contextmanager
def plain_worker_errors() -> Iterator[None]:
    """Raise what a DataLoader's worker process raised, or died of, as one sentence.

    DataLoader gives errors of its workers their whole traceback for a message.

    Raises:
        UserError: as the worker raised it.
        TrainingError: shared memory is too small, or a worker was ended from outside.
    """
    try:
        yield
    except UserError as error:
        if not _WRAPPED.match(error.whole):
            raise
        raise type(error)(_last_message(error)) from error
    except RuntimeError as error:
        said = f"{error} {error.__cause__ or ''}"  # which of the two names a signal is chance
        if not (_WRAPPED.match(said) or _LOST.search(said)):
            raise
        if _NO_SHARED_MEMORY.search(said):
            raise TrainingError(
                "the shared memory in /dev/shm is too small for the processes that prepare crops; give it more (docker "
                "run --shm-size 8g), or train with --workers 0"
            ) from error
        if lost := _LOST.search(said):
            raise TrainingError(
                f"a process that prepares crops {lost[1]}, often for lack of memory or of shared memory (/dev/shm); "
                "fewer --workers take less, --workers 0 takes none"
            ) from error
        raise


def _last_message(error: UserError) -> str:
    """The message at the end of the traceback that stands in an error's message."""
    kind = type(error)
    return error.whole.rpartition(f"{kind.__module__}.{kind.__qualname__}: ")[2].strip()

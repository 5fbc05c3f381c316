"""What an executor is."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Outcome(Generic[Job, Result]):
    """How one job ended: with a result, or with one sentence of what went wrong."""

    job: Job
    result: Result | None
    error: str | None = None


class Executor(Protocol):
    """Runs jobs somewhere. Closing the iterator early stops the work and leaves no process behind."""

    def run(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Generator[Outcome[Job, Result], None, None]:
        """Call a picklable function on every job, yielding outcomes as they come, in any order."""
        ...

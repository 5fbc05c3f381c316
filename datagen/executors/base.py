"""What an executor is."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeAlias, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Outcome(Generic[Job, Result]):
    """How one job ended: with a result, or with one sentence of what went wrong."""

    job: Job
    result: Result | None
    error: str | None = None


Outcomes: TypeAlias = Generator[Outcome[Job, Result], None, None]
"""Outcomes as they come; to be closed when no more of them are wanted."""


class Executor(Protocol):
    """Runs jobs somewhere. Closing the iterator early stops the work and leaves no process behind."""

    def run(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Outcomes[Job, Result]:
        """Call a picklable function on every job, yielding outcomes as they come, in any order."""
        ...

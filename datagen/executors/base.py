"""What an executor is."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeAlias, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

FailureKind = Literal["crash", "killed", "timeout", "memory", "exception", "disk_full"]


@dataclass(frozen=True)
class Failure:
    """Why a job gave no result."""

    kind: FailureKind
    sentence: str
    output: str = ""
    """The end of what the last attempt printed."""


@dataclass(frozen=True)
class Outcome(Generic[Job, Result]):
    """How one job ended: with a result, or with what went wrong."""

    job: Job
    result: Result | None
    failure: Failure | None = None
    attempts: int = 1


Outcomes: TypeAlias = Generator[Outcome[Job, Result], None, None]
"""Outcomes as they come; to be closed when no more of them are wanted."""


class Executor(Protocol):
    """Runs jobs somewhere. Closing the iterator early stops the work and leaves no process behind."""

    @property
    def threads(self) -> int:
        """How many CPU threads a job may use."""
        ...

    def run(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Outcomes[Job, Result]:
        """Call a picklable function on every job, yielding outcomes as they come, in any order."""
        ...

"""The interface of executors, and the outcomes that they yield."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Generic, Literal, Protocol, TypeAlias, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

FailureKind = Literal["crash", "killed", "timeout", "memory", "exception", "disk_full", "environment"]


@dataclass(frozen=True)
class Failure:
    """Why a job has no result."""

    kind: FailureKind
    """`disk_full` and `environment` are faults of the machine or the calling script, all others may be the job's."""
    sentence: str
    """What happened, in one sentence."""
    output: str = ""
    """The end of the last attempt's output."""


@dataclass(frozen=True)
class Outcome(Generic[Job, Result]):
    """How one job ended: with a result or a failure."""

    job: Job
    result: Result | None
    failure: Failure | None = None
    attempts: int = 1


Outcomes: TypeAlias = Generator[Outcome[Job, Result], None, None]
"""Outcomes as they come. Close the generator when no more of them are wanted."""


class Executor(Protocol):
    """Runs jobs in parallel."""

    @property
    def threads(self) -> int:
        """Number of CPU threads that a job may use."""
        ...

    def run(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Outcomes[Job, Result]:
        """Call a picklable function on every job and yield the outcomes as they come, in any order.

        Closing the generator early stops the work and leaves no process behind.
        """
        ...

"""One worker slot: it takes a job and gives an outcome, whatever happens to the process meanwhile."""

from __future__ import annotations

import errno
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from typing import Any

from datagen.errors import MachineError
from datagen.executors.base import Failure, FailureKind, Outcome
from stereoforge_kit.processes import Limits, WorkerError, WorkerProcess

MAX_KILLS = 30
"""How often a job may be killed from outside. It may not be the job's fault: a machine out of memory kills too."""
MAX_STARTS_KILLED = 100
"""How often in a row processes may be killed before they begin the job.

This is counted apart, since a process may take longer to start than a small job to run: with workers killed every four
seconds on a busy machine, 18 of 300 jobs were given up before any process had begun them.
"""
SAME_SUMS = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Matrix products on several threads add up in another order, and a scene's last bits would depend on the cores."""
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True)
class WorkerPolicy:
    """How worker processes are treated."""

    limits: Limits = field(default_factory=Limits)
    attempts: int = 2
    """How often a job that crashes its process or exceeds its limits is tried. An exception is final."""
    jobs_per_worker: int = 40
    """A process is replaced after so many jobs, since Blender's memory grows slowly."""
    recycle_bytes: int = 2 << 30
    """A process that holds more memory than this after a job is replaced."""


class Supervisor:
    """Runs one job at a time in a worker process that it starts, recycles and replaces as needed.

    Call `poll` until it returns the job's outcome, and wait on `waitables` in between.
    """

    def __init__(self, policy: WorkerPolicy, environment: Mapping[str, str] | None = None) -> None:
        self.policy = policy
        self._environment = environment
        self._worker: WorkerProcess | None = None
        self._jobs_done = 0
        self._call: tuple[Callable[[Any], Any], Any] | None = None
        self._tries = self._faults = self._kills = self._starts_killed = 0
        self._ran_s = 0.0

    @property
    def busy(self) -> bool:
        """Whether a job is running."""
        return self._call is not None

    @property
    def waitables(self) -> list[Connection | int]:
        """What `multiprocessing.connection.wait` can wait on until there may be news."""
        return self._worker.waitables if self._worker else []

    def start(self, function: Callable[[Any], Any], job: Any) -> None:
        """Start calling a picklable function on a job."""
        self._call = (function, job)
        self._tries = self._faults = self._kills = self._starts_killed = 0
        self._ran_s = 0.0
        self._try()

    def poll(self) -> Outcome[Any, Any] | None:
        """The outcome of the job, None while it is running."""
        assert self._call is not None
        assert self._worker is not None
        if not self._worker.poll():
            return None
        failure = None
        try:
            result = self._worker.result()
        except WorkerError as error:
            failure, result = Failure(error.kind, str(error), self._worker.output()), None
        except Exception as error:  # whatever the job raised is its outcome
            kind = _kind_of(error)
            sentence = f"{type(error).__name__}: {' '.join(str(error).split())}"
            failure, result = Failure(kind, sentence, self._worker.output()), None
        self._ran_s += self._worker.ran_s
        if failure and failure.kind == "killed" and self._ran_s >= self._most_s:
            failure = replace(failure, kind="timeout", sentence=self._hanging_sentence())
        elif failure and self._deserves_another_try(failure):
            self._try()
            return None
        outcome = Outcome(self._call[1], result, failure, self._tries)
        self._call = None
        self._recycle()
        return outcome

    def stop(self) -> None:
        """End the process and its job."""
        if self._worker:
            self._worker.stop()
        self._worker, self._call, self._jobs_done = None, None, 0

    def _try(self) -> None:
        assert self._call is not None
        if self._worker is None or not self._worker.alive:
            self._replace()
        assert self._worker is not None
        self._tries += 1
        self._worker.start(*self._call)

    @property
    def _most_s(self) -> float:
        """The time for all attempts of a job together, those that are killed from outside included."""
        return self.policy.attempts * self.policy.limits.timeout_s

    def _hanging_sentence(self) -> str:
        return (
            f"ran {self._ran_s:.0f} s in {self._tries} attempts, which were killed from outside, without an end: more "
            f"than the {self._most_s:g} s that {self.policy.attempts} attempts have"
        )

    def _deserves_another_try(self, failure: Failure) -> bool:
        assert self._worker is not None
        if failure.kind == "killed" and not self._worker.begun:
            self._starts_killed += 1
            return self._starts_killed < MAX_STARTS_KILLED
        self._starts_killed = 0
        if failure.kind == "killed":
            self._kills += 1
            return self._kills < MAX_KILLS
        self._faults += 1
        return failure.kind in ("crash", "timeout", "memory") and self._faults < self.policy.attempts

    def _replace(self) -> None:
        if self._worker:
            self._worker.stop()
        self._worker = WorkerProcess(self.policy.limits, {**SAME_SUMS, **(self._environment or {})})
        self._jobs_done = 0

    def _recycle(self) -> None:
        assert self._worker is not None
        self._jobs_done += 1
        used_up = self._jobs_done >= self.policy.jobs_per_worker
        if used_up or self._worker.resident_bytes() > self.policy.recycle_bytes:
            self._worker.stop()
            self._worker = None


def _kind_of(error: Exception) -> FailureKind:
    """What the system refuses, and modules that cannot be imported, are faults of the machine, not of the job."""
    number = error.errno if isinstance(error, OSError) else None
    if number in _NO_SPACE:
        return "disk_full"
    no_fault = number is not None or isinstance(error, ImportError | MachineError)
    return "environment" if no_fault else "exception"

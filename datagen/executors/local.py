"""Worker processes on this machine: recycled, timed out, and replaced when they crash (pebble)."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass
from itertools import islice
from typing import Any

from pebble import ProcessExpired, ProcessPool

from datagen.executors.base import Job, Outcome, Outcomes, Result


@dataclass(frozen=True)
class LocalExecutor:
    """Spawned processes, each taking one job at a time."""

    workers: int
    timeout_s: float = 1800.0
    """A job that runs longer is ended and counts as crashed."""
    attempts: int = 2
    """How often a job that crashed its worker is tried; an exception in the job is final."""
    jobs_per_worker: int = 40
    """A worker is replaced after so many jobs: Blender's memory grows slowly."""

    def run(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Outcomes[Job, Result]:
        queue = iter(jobs)
        pool = ProcessPool(
            max_workers=self.workers,
            max_tasks=self.jobs_per_worker,
            context=multiprocessing.get_context("spawn"),
        )
        running: dict[Future[Result], tuple[Job, int]] = {}

        def start(job: Job, attempt: int) -> None:
            running[pool.schedule(function, args=[job], timeout=self.timeout_s)] = (job, attempt)

        try:
            # A short queue ahead of the workers keeps them busy without pickling every job at once.
            for job in islice(queue, 2 * self.workers):
                start(job, 1)
            while running:
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    job, attempt = running.pop(future)
                    crash, outcome = _outcome(job, future)
                    if crash and attempt < self.attempts:
                        start(job, attempt + 1)
                        continue
                    for following in islice(queue, 1):
                        start(following, 1)
                    yield outcome
            pool.close()
        finally:
            pool.stop()
            pool.join()


def _outcome(job: Job, future: Future[Any]) -> tuple[bool, Outcome[Job, Any]]:
    """Whether the worker (rather than the job) failed, and the outcome if this was the last attempt."""
    try:
        return False, Outcome(job, future.result())
    except ProcessExpired as error:
        return True, Outcome(job, None, f"the worker process died with exit code {error.exitcode}")
    except TimeoutError:
        return True, Outcome(job, None, "the job ran into its time limit")
    except CancelledError:
        return False, Outcome(job, None, "the job was cancelled")
    except Exception as error:  # whatever the job raised is its outcome
        return False, Outcome(job, None, f"{type(error).__name__}: {error}")

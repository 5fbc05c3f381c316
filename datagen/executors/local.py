"""Worker processes on this machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import wait

from datagen.executors.base import Job, Outcomes, Result
from datagen.executors.supervisor import Supervisor, WorkerPolicy
from stereoforge_kit.processes.process import POLL_S


@dataclass(frozen=True)
class LocalExecutor:
    """Spawned worker processes, each with one job at a time."""

    environments: tuple[Mapping[str, str], ...]
    """The environment variables of each worker, such as the GPU that it may see."""
    policy: WorkerPolicy = field(default_factory=WorkerPolicy)

    @property
    def threads(self) -> int:
        """Number of CPU threads that a job may use: an equal share of this process's cores."""
        return max(1, len(os.sched_getaffinity(0)) // len(self.environments))

    def run(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Outcomes[Job, Result]:
        """Call a picklable function on every job and yield the outcomes as they come, in any order."""
        queue = iter(jobs)
        supervisors = [Supervisor(self.policy, environment) for environment in self.environments]
        try:
            busy = [supervisor for supervisor in supervisors if _begin(supervisor, function, queue)]
            while busy:
                wait([waitable for supervisor in busy for waitable in supervisor.waitables], POLL_S)
                for supervisor in list(busy):
                    if (outcome := supervisor.poll()) is None:
                        continue
                    if not _begin(supervisor, function, queue):
                        busy.remove(supervisor)
                    yield outcome
        finally:
            for supervisor in supervisors:
                supervisor.stop()


def _begin(supervisor: Supervisor, function: Callable[[Job], Result], queue: Iterator[Job]) -> bool:
    """Give the supervisor the next job of the queue, if there is one, else end its process."""
    for job in queue:
        supervisor.start(function, job)
        return True
    supervisor.stop()
    return False

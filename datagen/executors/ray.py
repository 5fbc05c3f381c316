"""Workers on the machines of a Ray cluster.

Ray decides where a job runs, and runs it again if a machine is lost. On the machine each Ray worker keeps one
supervised process, so time limit, memory limit, retries and logs are those of the local executor.
"""

from __future__ import annotations

import signal
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import islice
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from datagen.executors.base import Failure, Job, Outcome, Outcomes, Result
from datagen.executors.supervisor import Supervisor, WorkerPolicy
from stereoforge_kit.files import temporary_folder
from stereoforge_kit.processes.process import POLL_S

LOST_MACHINE_RETRIES = 10
"""How often Ray may run a job again after its machine or Ray worker was lost."""
QUEUED_PER_SLOT = 2
"""Jobs given to Ray for each that it can run at once: enough to keep it busy, few enough to be kept in memory."""
LONGEST_PLACE = 10
"""Longest path of a folder for temporary files in which Ray can make its sockets, whose names add 97 characters."""
CANCEL_ROUNDS, CANCEL_ROUND_S = 12, 5.0
"""How often running jobs are asked to end, and how many seconds each time may take, before they are left to Ray."""


@dataclass(frozen=True)
class RayExecutor:
    """Runs jobs as Ray tasks, on an existing cluster or on one of this machine for the time of the run."""

    address: str | None = None
    """Address of a cluster, such as `auto` or `ray://host:10001`; None for a cluster of this machine alone."""
    workers: int | None = None
    """Most jobs at once; None for as many as the cluster's resources allow."""
    cpus_per_job: int = 1
    gpus_per_job: float = 0.0
    policy: WorkerPolicy = field(default_factory=WorkerPolicy)

    @property
    def threads(self) -> int:
        """Number of CPU threads that a job may use."""
        return self.cpus_per_job

    @property
    def runs_here(self) -> bool:
        """Whether all jobs run on this machine."""
        import ray

        return self.address is None and not ray.is_initialized()

    def run(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Outcomes[Job, Result]:
        """Call a picklable function on every job and yield the outcomes as they come, in any order."""
        import ray

        queue = iter(jobs)
        running: dict[Any, Job] = {}
        with _connected(self, running):
            task = ray.remote(
                num_cpus=self.cpus_per_job,
                num_gpus=self.gpus_per_job,
                max_calls=self.policy.jobs_per_worker,
                max_retries=LOST_MACHINE_RETRIES,
            )(_run_supervised)
            while True:
                room = QUEUED_PER_SLOT * self._slots() - len(running)
                for job in islice(queue, max(0, room)):
                    running[task.remote(function, job, self.policy)] = job
                if not running:
                    return
                # The timeout lets machines that join the cluster get their share.
                done, _ = ray.wait(list(running), num_returns=1, timeout=5.0)
                for reference in done:
                    yield _outcome(running.pop(reference), reference)

    def _slots(self) -> int:
        """How many jobs the cluster can run at once as it is now."""
        import ray

        resources = ray.cluster_resources()
        slots = int(resources.get("CPU", 0) // self.cpus_per_job)
        if self.gpus_per_job:
            slots = min(slots, int(resources.get("GPU", 0) // self.gpus_per_job))
        return max(1, slots if self.workers is None else min(slots, self.workers))


def _cancel(references: list[Any]) -> None:
    """End these tasks wherever they are.

    A request that overtakes its task on the way to the worker is lost, and the task runs after all; so those
    that have not ended are asked again.
    """
    import ray

    for _ in range(CANCEL_ROUNDS):
        for reference in references:
            ray.cancel(reference, force=True)
        if not references:
            return
        _, references = ray.wait(references, num_returns=len(references), timeout=CANCEL_ROUND_S)


@contextmanager
def _connected(executor: RayExecutor, running: Collection[Any]) -> Iterator[None]:
    """Use this process's connection to Ray if it has one, else make one; end what is running at the end.

    With our own connection everything ends that came by it. To cancel would be a risk: a task that is done just
    then makes Ray abort this process (Ray's issue of `submissible_tasks_`, met with Ray 2.60).
    """
    import ray

    if ray.is_initialized():
        try:
            yield
        finally:
            _cancel(list(running))
        return
    with _cluster(executor) as settings:
        before = signal.getsignal(signal.SIGTERM)
        ray.init(**settings, log_to_driver=False, logging_level="ERROR", configure_logging=True)
        with suppress(ValueError):  # Ray takes SIGTERM for itself, in the main thread alone.
            signal.signal(signal.SIGTERM, before)
        try:
            yield
        finally:
            ray.shutdown()


@contextmanager
def _cluster(executor: RayExecutor) -> Iterator[dict[str, Any]]:
    """What `ray.init` takes for the executor's cluster, and Ray's folder while it is one of this machine alone."""
    if executor.address is not None:
        yield {"address": executor.address}
        return
    cpus = None if executor.workers is None else executor.workers * executor.cpus_per_job
    here = {"address": "local", "num_cpus": cpus, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
    place = Path(tempfile.gettempdir())
    with temporary_folder(place if len(str(place)) <= LONGEST_PLACE else Path("/tmp")) as folder:
        yield here | {"_temp_dir": str(folder)}


def _outcome(job: Any, reference: Any) -> Outcome[Any, Any]:
    """What Ray gives for a finished job, errors of Ray's own included."""
    import ray

    try:
        result, failure, attempts = ray.get(reference)
    except ray.exceptions.RayError as error:
        sentence = f"its machine or Ray worker was lost: {str(error).strip().splitlines()[0]}"
        return Outcome(job, None, Failure("killed", sentence, str(error)), LOST_MACHINE_RETRIES + 1)
    return Outcome(job, result, failure, attempts)


_supervisor: Supervisor | None = None


def _run_supervised(
    function: Callable[[Any], Any], job: Any, policy: WorkerPolicy
) -> tuple[Any, Failure | None, int]:
    """In a Ray worker: run a job in the worker's supervised process and wait for its outcome."""
    global _supervisor
    if _supervisor is None or _supervisor.policy != policy:
        _supervisor = Supervisor(policy)
    _supervisor.start(function, job)
    try:
        while (outcome := _supervisor.poll()) is None:
            wait(_supervisor.waitables, POLL_S)
    except BaseException:  # Cancelled: the process must not go on with a job that nobody waits for.
        _supervisor.stop()
        raise
    return outcome.result, outcome.failure, outcome.attempts

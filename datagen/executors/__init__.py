"""Ways to run independent jobs in parallel: an executor takes a function and jobs and yields an outcome for each."""

from datagen.executors.base import Executor, Failure, Outcome, Outcomes
from datagen.executors.local import LocalExecutor
from datagen.executors.ray import RayExecutor
from datagen.executors.supervisor import WorkerPolicy

__all__ = ["Executor", "Failure", "LocalExecutor", "Outcome", "Outcomes", "RayExecutor", "WorkerPolicy"]

"""Ways to spread independent jobs: each takes a function and jobs, and yields an outcome for each."""

from datagen.executors.base import Executor, Outcome, Outcomes
from datagen.executors.local import LocalExecutor

__all__ = ["Executor", "LocalExecutor", "Outcome", "Outcomes"]

"""The Lightning modules, one a task."""

from training.tasks.base import StereoTask
from training.tasks.free import FreeConfNetTask, FreeGradNetTask
from training.tasks.heads import ConfNetTask, GradNetTask
from training.tasks.joint import JointHeads, JointTask
from training.tasks.regressor import FineTuningTask, RegressorTask

__all__ = [
    "ConfNetTask",
    "FineTuningTask",
    "FreeConfNetTask",
    "FreeGradNetTask",
    "GradNetTask",
    "JointHeads",
    "JointTask",
    "RegressorTask",
    "StereoTask",
]

"""The Lightning modules that train the networks, one per task."""

from training.tasks.base import StereoTask
from training.tasks.heads import ConfNetTask, GradNetTask
from training.tasks.joint import JointHeads, JointTask
from training.tasks.regressor import FineTuningTask, RegressorTask
from training.tasks.regressor_free import RegressorFreeConfNetTask, RegressorFreeGradNetTask

__all__ = [
    "ConfNetTask",
    "FineTuningTask",
    "GradNetTask",
    "JointHeads",
    "JointTask",
    "RegressorFreeConfNetTask",
    "RegressorFreeGradNetTask",
    "RegressorTask",
    "StereoTask",
]

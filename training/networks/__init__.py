"""The networks: DispNetCorr1D, and ConfNet and GradNet which look at its features.

Their default constructors give the published (full) networks.
"""

from training.networks.confnet import ConfNet
from training.networks.correlation import Correlation1D, correlate_1d
from training.networks.gradnet import PUBLISHED_GRADNET, GradNet
from training.networks.heads import HeadConfig
from training.networks.lrc import left_right_consistency, predict_right
from training.networks.regressors.dispnet import (
    DispNetConfig,
    DispNetCorr1D,
    DispNetOutput,
    full_resolution,
)

__all__ = [
    "PUBLISHED_GRADNET",
    "ConfNet",
    "Correlation1D",
    "DispNetConfig",
    "DispNetCorr1D",
    "DispNetOutput",
    "GradNet",
    "HeadConfig",
    "correlate_1d",
    "full_resolution",
    "left_right_consistency",
    "predict_right",
]

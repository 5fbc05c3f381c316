"""The networks: a regressor predicts disparity; ConfNet and GradNet judge it from its matching features.

The regressors are DispNetCorr1D, the paper's, and CostVolumeNet, ours. The default constructors of the paper's networks
give the full ones.

Examples:
    >>> import torch
    >>> from training.networks import ConfNet, DispNetConfig, DispNetCorr1D, HeadConfig
    >>> regressor = DispNetCorr1D(DispNetConfig(width=0.0625)).eval()
    >>> confnet = ConfNet(HeadConfig(width=8, hidden=8).on(regressor)).eval()
    >>> left, right = torch.rand(2, 1, 3, 64, 128)
    >>> with torch.no_grad():
    ...     output = regressor(left, right)
    >>> disparity = full_resolution(output.disparities[-1], (64, 128)).relu()
    >>> disparity.shape
    torch.Size([1, 1, 64, 128])
    >>> consistency = left_right_consistency(disparity, disparity)
    >>> confnet.confidence(left, output.features, consistency).shape
    torch.Size([1, 1, 64, 128])
"""

from training.networks.confnet import ConfNet
from training.networks.correlation import Correlation1D, correlate_1d
from training.networks.cost_volume_layers import CostVolumeConfig
from training.networks.gradnet import PUBLISHED_GRADNET, GradNet
from training.networks.heads import HeadConfig
from training.networks.lrc import left_right_consistency, predict_right
from training.networks.regressors.costvolume import CostVolumeNet
from training.networks.regressors.dispnet import (
    DispNetConfig,
    DispNetCorr1D,
    DispNetOutput,
    full_resolution,
)
from training.networks.regressors.interface import Regression, Regressor

__all__ = [
    "PUBLISHED_GRADNET",
    "ConfNet",
    "Correlation1D",
    "CostVolumeConfig",
    "CostVolumeNet",
    "DispNetConfig",
    "DispNetCorr1D",
    "DispNetOutput",
    "GradNet",
    "HeadConfig",
    "Regression",
    "Regressor",
    "correlate_1d",
    "full_resolution",
    "left_right_consistency",
    "predict_right",
]

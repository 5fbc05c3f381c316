"""DispNetCorr1D as one would write it down from the layer table: the rival of `benchmarks/train.py`.

Eager PyTorch, both views through the shared layers one after the other, the correlation as a loop over displacements.
"""

from __future__ import annotations

from itertools import pairwise

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from training.networks import DispNetConfig


def _layer(in_channels: int, channels: int, kernel: int, stride: int, batch_norm: bool) -> nn.Sequential:
    layers: list[nn.Module] = [nn.Conv2d(in_channels, channels, kernel, stride, kernel // 2)]
    layers += [nn.BatchNorm2d(channels)] if batch_norm else []
    return nn.Sequential(*layers, nn.LeakyReLU(0.1))


def _upsampling(in_channels: int, channels: int, batch_norm: bool) -> nn.Sequential:
    layers: list[nn.Module] = [nn.ConvTranspose2d(in_channels, channels, 4, 2, 1)]
    layers += [nn.BatchNorm2d(channels)] if batch_norm else []
    return nn.Sequential(*layers, nn.LeakyReLU(0.1))


class PlainDispNet(nn.Module):
    """The network of a DispNetConfig."""

    def __init__(self, config: DispNetConfig) -> None:
        super().__init__()
        c32, c64, c128, c256, c512, c1024 = (
            round(config.width * channels) for channels in (32, 64, 128, 256, 512, 1024)
        )
        norm = config.normalization == "batch"
        self.reach, self.one_sided = config.max_displacement, config.one_sided
        displacements = self.reach + 1 if config.one_sided else 2 * self.reach + 1
        self.conv1, self.conv2 = _layer(3, c64, 7, 2, norm), _layer(c64, c128, 5, 2, norm)
        self.redir = _layer(c128, c64, 1, 1, norm)
        self.conv3 = _layer(displacements + c64, c256, 5, 2, norm)
        self.conv3_1 = _layer(c256, c256, 3, 1, norm)
        self.conv4, self.conv4_1 = _layer(c256, c512, 3, 2, norm), _layer(c512, c512, 3, 1, norm)
        self.conv5, self.conv5_1 = _layer(c512, c512, 3, 2, norm), _layer(c512, c512, 3, 1, norm)
        self.conv6, self.conv6_1 = _layer(c512, c1024, 3, 2, norm), _layer(c1024, c1024, 3, 1, norm)
        widths = (c1024, c512, c256, c128, c64, c32)
        skips = (c512, c512, c256, c128, c64)
        self.predictions = nn.ModuleList(nn.Conv2d(channels, 1, 3, 1, 1) for channels in widths)
        self.upconvs = nn.ModuleList(
            _upsampling(below, channels, norm) for below, channels in pairwise(widths)
        )
        self.upsampled = nn.ModuleList(nn.ConvTranspose2d(1, 1, 4, 2, 1) for _ in skips)
        self.iconvs = nn.ModuleList(
            nn.Conv2d(skip + channels + 1, channels, 3, 1, 1)
            for skip, channels in zip(skips, widths[1:], strict=True)
        )

    def correlation(self, left: Tensor, right: Tensor) -> Tensor:
        width = left.shape[-1]
        last = 0 if self.one_sided else self.reach
        padded = F.pad(right, (self.reach, last))
        return torch.stack(
            [
                (left * padded[..., shift : shift + width]).mean(dim=1)
                for shift in range(self.reach + last + 1)
            ],
            dim=1,
        )

    def forward(self, left: Tensor, right: Tensor) -> list[Tensor]:
        conv1 = self.conv1(left)
        conv2, other = self.conv2(conv1), self.conv2(self.conv1(right))
        conv3 = self.conv3(torch.cat([self.correlation(conv2, other), self.redir(conv2)], dim=1))
        conv3 = self.conv3_1(conv3)
        conv4 = self.conv4_1(self.conv4(conv3))
        conv5 = self.conv5_1(self.conv5(conv4))
        features = self.conv6_1(self.conv6(conv5))
        outputs = [self.predictions[0](features)]
        for stage, skip in enumerate((conv5, conv4, conv3, conv2, conv1)):
            up = self.upconvs[stage](features)
            joined = torch.cat([skip, up, self.upsampled[stage](outputs[-1])], dim=1)
            features = self.iconvs[stage](joined)
            outputs.append(self.predictions[stage + 1](features))
        return outputs

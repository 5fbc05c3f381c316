"""Optical flow as FlyingThings3D stores it: a float map of three channels, u, v and zeros."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.pfm import read_pfm, write_pfm


def read_flow(path: Path | str) -> NDArray[np.float32]:
    """Read (H, W, 2) float32 displacements [to the right, down] in pixels; NaN invalid. Raises FormatError."""
    flow = read_pfm(path)
    if flow.ndim != 3:
        raise FormatError(f"{path}: has one channel, where optical flow has three")
    return np.ascontiguousarray(flow[..., :2])


def write_flow(path: Path | str, flow: NDArray[np.float32]) -> None:
    """Write (H, W, 2) displacements [to the right, down] in pixels."""
    if flow.ndim != 3 or flow.shape[2] != 2:
        raise FormatError(f"{path}: optical flow is (H, W, 2) numbers, not {flow.shape}")
    write_pfm(path, np.concatenate([flow, np.zeros_like(flow[..., :1])], axis=-1))

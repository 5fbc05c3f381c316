"""Optical flow as FlyingThings3D stores it: a PFM file of three channels, u, v and zeros."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.pfm import read_pfm, write_pfm


def read_flow(path: Path | str) -> NDArray[np.float32]:
    """Read optical flow: (H, W, 2) float32 displacements [to the right, down] in pixels, NaN where invalid.

    Raises FormatError for a file that is missing, damaged, no PFM file or of one channel. `write_flow` has an
    example.
    """
    flow = read_pfm(path)
    if flow.ndim != 3:
        raise FormatError(f"{path}: has one channel, where optical flow has three")
    return np.ascontiguousarray(flow[..., :2])


def write_flow(path: Path | str, flow: NDArray[np.float32]) -> None:
    """Write optical flow: (H, W, 2) displacements [to the right, down] in pixels, stored as float32.

    Raises FormatError for an array of another shape.

    >>> import tempfile
    >>> flow = np.zeros((2, 3, 2), np.float32)
    >>> flow[0, 0] = (1.5, -0.25)  # 1.5 px to the right and 0.25 px up
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "flow.pfm"
    ...     write_flow(path, flow)
    ...     again = read_flow(path)
    >>> again.shape, again[0, 0].tolist()
    ((2, 3, 2), [1.5, -0.25])
    """
    if flow.ndim != 3 or flow.shape[2] != 2:
        raise FormatError(f"{path}: optical flow is (H, W, 2) numbers, not {flow.shape}")
    write_pfm(path, np.concatenate([flow, np.zeros_like(flow[..., :1])], axis=-1))

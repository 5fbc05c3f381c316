"""Disparity gradients as OpenEXR: channels `dx`, `dy`, `valid` (0 or 1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.exr import read_channels, write_channels


def read_gradient(path: Path | str) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Read forward differences: gradient (H, W, 2) float32 as [dx, dy], and valid (H, W) bool.

    Raises FormatError.
    """
    planes = read_channels(Path(path), ("dx", "dy", "valid"))
    valid = planes["valid"]
    if not np.isin(valid, (0, 1)).all():
        raise FormatError(f"{path}: its channel 'valid' has values other than 0 and 1")
    return np.stack([planes["dx"], planes["dy"]], axis=-1), valid == 1


def write_gradient(path: Path | str, gradient: NDArray[np.float32], valid: NDArray[np.bool_]) -> None:
    """Write forward differences: gradient (H, W, 2) as [dx, dy], and valid (H, W) bool."""
    path = Path(path)
    if gradient.ndim != 3 or gradient.shape[2] != 2 or gradient.shape[:2] != valid.shape or valid.size == 0:
        raise FormatError(
            f"{path}: a gradient is (H, W, 2) numbers with an (H, W) mask, "
            f"not {gradient.shape} with {valid.shape}"
        )
    write_channels(path, {"dx": gradient[..., 0], "dy": gradient[..., 1], "valid": valid})

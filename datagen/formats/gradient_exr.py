"""Disparity gradients as OpenEXR files with the channels `dx`, `dy` and `valid` (0 or 1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.exr import read_channels, write_channels


def read_gradient(path: Path | str) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Read a disparity gradient and its validity mask.

    Returns:
        The forward differences (H, W, 2) float32 as [dx, dy], in px per px, and the mask (H, W) bool.

    Raises:
        FormatError: For a file that is missing, damaged or has other channels. `write_gradient` has an example.
    """
    planes = read_channels(Path(path), ("dx", "dy", "valid"))
    valid = planes["valid"]
    if not np.isin(valid, (0, 1)).all():
        raise FormatError(f"{path}: its channel 'valid' has values other than 0 and 1")
    return np.stack([planes["dx"], planes["dy"]], axis=-1), valid == 1


def write_gradient(path: Path | str, gradient: NDArray[np.float32], valid: NDArray[np.bool_]) -> None:
    """Write a disparity gradient and its validity mask.

    Args:
        path: The file to write.
        gradient: (H, W, 2) forward differences [dx, dy] in px per px, stored as float32.
        valid: (H, W) bool, False at discontinuities and where a difference does not exist.

    Raises:
        FormatError: For arrays of other shapes, or empty ones.

    >>> import tempfile
    >>> gradient, valid = np.full((2, 3, 2), 0.5, np.float32), np.ones((2, 3), bool)
    >>> valid[:, -1] = valid[-1] = False  # The last column and row have no forward difference.
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "gradient.exr"
    ...     write_gradient(path, gradient, valid)
    ...     again, mask = read_gradient(path)
    >>> np.array_equal(again, gradient), mask.tolist()
    (True, [[True, True, False], [False, False, False]])
    """
    path = Path(path)
    if gradient.ndim != 3 or gradient.shape[2] != 2 or gradient.shape[:2] != valid.shape or valid.size == 0:
        raise FormatError(
            f"{path}: a gradient is (H, W, 2) numbers with an (H, W) mask, "
            f"not {gradient.shape} with {valid.shape}"
        )
    write_channels(path, {"dx": gradient[..., 0], "dy": gradient[..., 1], "valid": valid})

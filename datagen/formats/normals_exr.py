"""Surface normals as OpenEXR files with the channels `x`, `y` and `z`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.exr import read_channels, write_channels

_CHANNELS = ("x", "y", "z")


def read_normals(path: Path | str) -> NDArray[np.float32]:
    """Read normals: (H, W, 3) float32 vectors [x, y, z], as they were written.

    Raises FormatError for a file that is missing, damaged or has other channels. `write_normals` has an example.
    """
    planes = read_channels(Path(path), _CHANNELS)
    return np.stack([planes[name] for name in _CHANNELS], axis=-1)


def write_normals(path: Path | str, normals: NDArray[np.float32]) -> None:
    """Write normals: (H, W, 3) vectors [x, y, z], stored as float32.

    In a data set they are unit vectors in the camera's frame (x right, y up, z towards the camera), 0 for the sky.
    Raises FormatError for an array of another shape.

    >>> import tempfile
    >>> normals = np.zeros((2, 3, 3), np.float32)
    >>> normals[1] = (0.0, 1.0, 0.0)  # The lower row shows ground, the upper one sky.
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "normals.exr"
    ...     write_normals(path, normals)
    ...     again = read_normals(path)
    >>> np.array_equal(again, normals)
    True
    """
    path = Path(path)
    if normals.ndim != 3 or normals.shape[2] != 3 or normals.size == 0:
        raise FormatError(f"{path}: normals are (H, W, 3) numbers, not {normals.shape}")
    write_channels(path, {name: normals[..., k] for k, name in enumerate(_CHANNELS)})

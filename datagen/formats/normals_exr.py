"""Surface normals as OpenEXR: channels `x`, `y`, `z`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.exr import read_channels, write_channels

_CHANNELS = ("x", "y", "z")


def read_normals(path: Path | str) -> NDArray[np.float32]:
    """Read (H, W, 3) float32 vectors. Raises FormatError."""
    planes = read_channels(Path(path), _CHANNELS)
    return np.stack([planes[name] for name in _CHANNELS], axis=-1)


def write_normals(path: Path | str, normals: NDArray[np.float32]) -> None:
    """Write (H, W, 3) vectors."""
    path = Path(path)
    if normals.ndim != 3 or normals.shape[2] != 3 or normals.size == 0:
        raise FormatError(f"{path}: normals are (H, W, 3) numbers, not {normals.shape}")
    write_channels(path, {name: normals[..., k] for k, name in enumerate(_CHANNELS)})

"""Depth in metres as OpenEXR files with the channel `Z`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.exr import read_channels, write_channels

_CHANNELS = ("Z",)


def read_depth(path: Path | str) -> NDArray[np.float32]:
    """Read a depth: (H, W) float32 metres, infinite for the sky, as it was written.

    Raises FormatError for a file that is missing, damaged or has other channels. `write_depth` has an example.
    """
    return read_channels(Path(path), _CHANNELS)["Z"]


def write_depth(path: Path | str, depth: NDArray[np.floating[Any]]) -> None:
    """Write a depth: (H, W) metres along the optical axis, infinite for the sky, stored as float32.

    Raises FormatError for an array of another shape.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "depth.exr"
    ...     write_depth(path, np.array([[np.inf, 4.5]]))
    ...     depth = read_depth(path)
    >>> depth.tolist()
    [[inf, 4.5]]
    """
    path = Path(path)
    if depth.ndim != 2 or depth.size == 0:
        raise FormatError(f"{path}: a depth is (H, W) numbers, not {depth.shape}")
    write_channels(path, {"Z": depth})

"""Depth in whole millimetres as 16-bit PNG, as depth cameras give it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.formats.png import write_png

MILLIMETRES = 1000
FARTHEST_M = np.iinfo(np.uint16).max / MILLIMETRES
"""65.535 m: 16 bits hold no depth beyond it."""


def write_depth_png(path: Path | str, depth: NDArray[np.floating[Any]]) -> float:
    """Write a depth (H, W) in metres as whole millimetres, 0 where 16 bits cannot hold it.

    Returns the share of pixels whose depth is finite and too far.

    >>> import tempfile
    >>> from datagen.formats.png import read_png
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "depth.png"
    ...     too_far = write_depth_png(path, np.array([[1.2344, 65.535, 65.536, np.inf]]))
    ...     stored = read_png(path)
    >>> stored.tolist(), too_far
    ([[1234, 65535, 0, 0]], 0.25)
    """
    known = np.isfinite(depth)
    rounded = np.rint(np.where(known, depth, 0.0).astype(np.float64) * MILLIMETRES)
    too_far = rounded > np.iinfo(np.uint16).max
    write_png(path, np.where(too_far, 0, rounded).astype(np.uint16))
    return float(too_far.mean())

"""Read the disparity of another predictor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import read_pfm_disparity
from datagen.sources.kitti import read_disparity as read_kitti
from stereoforge.errors import CommandError

READERS = {".pfm": read_pfm_disparity, ".png": read_kitti}
"""By the file's ending."""


def read_disparity(path: Path, size: tuple[int, int]) -> NDArray[np.float32]:
    """(H, W) pixels of a PFM, or of a 16-bit PNG as KITTI has it (value / 256, 0 for none).

    NaN, infinite and negative values all mean that there is none, and become NaN; a 0 in a PFM is infinitely far.

    Args:
        size: (height, width) it must have.

    Raises:
        CommandError: A file of another kind or size, or without any disparity.
        DatasetError: A damaged file.
    """
    if path.suffix.lower() not in READERS:
        raise CommandError(f"{path}: a disparity is a .pfm or a 16-bit .png file")
    if not path.is_file():
        raise CommandError(f"{path}: there is no such file")
    disparity = READERS[path.suffix.lower()](path)
    if disparity.shape != size:
        got = "x".join(map(str, disparity.shape[1::-1]))
        raise CommandError(f"{path}: is {got}, the pictures are {size[1]}x{size[0]}")
    disparity = np.where(np.isfinite(disparity) & (disparity >= 0), disparity, np.nan).astype(np.float32)
    if np.isnan(disparity).all():
        raise CommandError(f"{path}: holds no disparity, every pixel is marked as having none")
    return disparity

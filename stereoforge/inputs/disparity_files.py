"""Read the disparity of another predictor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import read_pfm_disparity
from datagen.formats.impossible_disparity import PREDICTION_NOISE_PX, drop_impossible
from datagen.sources.kitti import read_disparity as read_kitti
from stereoforge.errors import CommandError

READERS = {".pfm": read_pfm_disparity, ".png": read_kitti}
"""By the file's ending."""


MOSTLY = 0.5
"""From this share of impossible values on, the disparity is probably meant otherwise."""


def read_disparity(path: Path, size: tuple[int, int]) -> tuple[NDArray[np.float32], list[str]]:
    """(H, W) pixels of a PFM, or of a 16-bit PNG as KITTI has it (value / 256, 0 for none), and remarks about it.

    Where there is none the array is NaN: what is not finite, larger than the picture is wide, or negative by more than
    noise. A 0 in a PFM is infinitely far.

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
    disparity, impossible = drop_impossible(disparity, PREDICTION_NOISE_PX)
    sign = "; is the sign the other way round?" if impossible.negative > MOSTLY else ""
    if np.isnan(disparity).all():
        reason = str(impossible) if impossible else "every pixel is marked as having none"
        raise CommandError(f"{path}: holds no disparity, {reason}{sign}")
    return disparity, [f"{path}: {impossible}{sign}"] if impossible else []

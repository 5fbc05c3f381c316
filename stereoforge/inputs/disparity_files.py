"""Read the disparity of another predictor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import disparity as formats
from datagen.formats.impossible_disparity import PREDICTION_NOISE_PX, drop_impossible
from stereoforge.errors import CommandError

MOSTLY = 0.5
"""From this share of impossible values on, the disparity is probably meant otherwise."""


def read_disparity(
    path: Path, size: tuple[int, int], units_per_px: float | None = None
) -> tuple[NDArray[np.float32], list[str]]:
    """(H, W) pixels of a file in one of `datagen.formats.disparity`'s formats, and remarks about it.

    Where there is none the array is NaN: what is not finite, larger than the picture is wide, or negative by more than
    noise. A 0 in a PFM is infinitely far.

    Args:
        size: (height, width) it must have.
        units_per_px: What a pixel of disparity is stored as; None for what the format says.

    Raises:
        CommandError: A file of another kind or size, or without any disparity.
        DatasetError: A damaged file.
    """
    if path.suffix.lower() not in formats.disparity_formats():
        raise CommandError(f"{path}: a disparity is {formats.disparity_kinds()}")
    if not path.is_file():
        raise CommandError(f"{path}: there is no such file")
    reading = formats.read_disparity(path, units_per_px)
    disparity = reading.disparity
    if disparity.shape != size:
        got = "x".join(map(str, disparity.shape[1::-1]))
        raise CommandError(f"{path}: is {got}, the pictures are {size[1]}x{size[0]}")
    disparity, impossible = drop_impossible(disparity, PREDICTION_NOISE_PX)
    sign = "; is the sign the other way round?" if impossible.negative > MOSTLY else ""
    if np.isnan(disparity).all():
        reason = str(impossible) if impossible else "every pixel is marked as having none"
        raise CommandError(f"{path}: holds no disparity, {reason}{sign}")
    remarks = [*reading.remarks, f"{impossible}{sign}"] if impossible else reading.remarks
    return disparity, [f"{path}: {remark}" for remark in remarks]

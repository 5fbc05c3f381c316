"""Every format of disparity files, found by the endings of their names."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.disparity.meaning import in_pixels
from datagen.formats.disparity.record import DisparityFormat, DisparityReading


@cache
def disparity_formats() -> dict[str, DisparityFormat]:
    """All formats by the endings of their files, in small letters with their dots."""
    from datagen.formats.disparity import codecs
    from stereoforge_kit.discovery import modules_in

    formats = [module.FORMAT for module in modules_in(codecs)]
    return {ending: each for each in formats for ending in each.endings}


def disparity_kinds() -> str:
    """What there is, for messages: "a .pfm, a 16-bit .png, ... or a .npz file"."""
    titles = list(dict.fromkeys(each.title for each in disparity_formats().values()))
    return f"{', '.join(titles[:-1])} or {titles[-1]} file"


def read_disparity(path: Path, units_per_px: float | None = None) -> DisparityReading:
    """Read a disparity in any format: (H, W) float32 px, NaN where the file says that there is none, and remarks.

    Args:
        path: The file; its ending decides the format.
        units_per_px: What a pixel of disparity is stored as; None for the format's own
            (`datagen.formats.disparity.meaning`).

    Raises:
        FormatError: a file of an unknown ending, a missing or a damaged one, or one that is no disparity.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "disparity.png"
    ...     write_disparity(path, np.array([[1.5, np.nan]], np.float32), units_per_px=100)
    ...     reading = read_disparity(path, units_per_px=100)
    >>> reading.disparity.tolist()
    [[1.5, nan]]
    """
    found = _format_of(path)
    return in_pixels(path, found.read(path), units_per_px, found.units_per_px)


def read_disparity_map(path: Path, units_per_px: float | None = None) -> NDArray[np.float32]:
    """`read_disparity` without its remarks."""
    return read_disparity(path, units_per_px).disparity


def write_disparity(
    path: Path, disparity: NDArray[np.floating[Any]], units_per_px: float | None = None
) -> None:
    """Write a disparity (H, W) px, NaN where there is none, in the format of the file's ending.

    PNG files have 16 bits, 256 units a pixel where nothing else is asked for, 0 for none and 1 for the smallest. TIFF
    files do as well if a scale is asked for. Everything else has 32-bit floating numbers.

    Raises:
        FormatError: an unknown ending, another shape, or a disparity that 16 bits do not hold.
    """
    found = _format_of(path)
    if disparity.ndim != 2 or disparity.size == 0:
        raise FormatError(f"{path}: a disparity is (H, W), not {disparity.shape}")
    found.write(path, np.asarray(disparity, np.float32), units_per_px)


def _format_of(path: Path) -> DisparityFormat:
    found = disparity_formats().get(path.suffix.lower())
    if found is None:
        raise FormatError(f"{path}: a disparity is {disparity_kinds()}")
    return found

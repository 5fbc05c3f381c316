"""Grey PNG files: 16 bits, 256 units a pixel as in KITTI's; of 8 bits, as old sets have them, with a stated scale."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.disparity.meaning import PNG_UNITS_PER_PX, to_units
from datagen.formats.disparity.record import DisparityFormat
from datagen.formats.png import read_png, write_png


def read_disparity_png(path: Path) -> NDArray[np.float32]:
    """Read a disparity as KITTI has it: (H, W) float32 px, NaN where there is none.

    Raises:
        FormatError: a file that is none.
    """
    values = _read(path)
    if values.dtype != np.uint16:
        raise FormatError(f"{path}: a disparity is a 16-bit grey PNG, not {values.dtype}")
    disparity = values.astype(np.float32) / PNG_UNITS_PER_PX
    disparity[values == 0] = np.nan
    return disparity


def _read(path: Path) -> NDArray[Any]:
    values = read_png(path)
    if values.ndim != 2:
        raise FormatError(f"{path}: a disparity is a 16-bit grey PNG, not {values.dtype} {values.shape}")
    return values


def _write(path: Path, disparity: NDArray[np.float32], units_per_px: float | None) -> None:
    write_png(path, to_units(disparity, units_per_px or PNG_UNITS_PER_PX, path))


FORMAT = DisparityFormat("a 16-bit .png", (".png",), _read, _write, PNG_UNITS_PER_PX)

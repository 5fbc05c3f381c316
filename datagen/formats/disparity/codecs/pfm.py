"""Portable float maps: 32-bit floating pixels (`datagen.formats.pfm`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats.disparity.meaning import in_floats
from datagen.formats.disparity.record import DisparityFormat
from datagen.formats.pfm import read_pfm_disparity, write_pfm


def _write(path: Path, disparity: NDArray[np.float32], units_per_px: float | None) -> None:
    write_pfm(path, in_floats(disparity, units_per_px))


FORMAT = DisparityFormat("a .pfm", (".pfm",), read_pfm_disparity, _write)

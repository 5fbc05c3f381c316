"""Disparity maps of one view in whatever format a program wrote them: one way to read and to write all of them.

A format is a module in `datagen.formats.disparity.codecs` with a `FORMAT`, found without being registered. It says how
numbers lie in its files; what the numbers mean is the same for all (`datagen.formats.disparity.meaning`).
"""

from datagen.formats.disparity.codecs.png import read_disparity_png
from datagen.formats.disparity.meaning import PNG_UNITS_PER_PX, to_units
from datagen.formats.disparity.record import DisparityFormat, DisparityReading
from datagen.formats.disparity.registry import (
    disparity_formats,
    disparity_kinds,
    read_disparity,
    read_disparity_map,
    write_disparity,
)

__all__ = [
    "PNG_UNITS_PER_PX",
    "DisparityFormat",
    "DisparityReading",
    "disparity_formats",
    "disparity_kinds",
    "read_disparity",
    "read_disparity_map",
    "read_disparity_png",
    "to_units",
    "write_disparity",
]

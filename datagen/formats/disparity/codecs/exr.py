"""OpenEXR files with one channel of floating pixels, or with several that are alike, as programs for pictures write
grey. Other people's files have other compressions, tiles and attributes than ours, so only the header is checked before
OpenEXR decodes them.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.disparity.meaning import in_floats
from datagen.formats.disparity.record import DisparityFormat
from datagen.formats.exr import write_channels
from datagen.formats.limits import check_image_size, read_bounded
from stereoforge_kit.messages import listed, shortened

_MAGIC = struct.pack("<I", 20000630)
_DEEP, _PARTS = 0x800, 0x1000
"""Flags behind the version number."""
_CHANNEL = "Y"
"""What OpenEXR calls a grey channel, so that every viewer shows it."""
_DEPTH = "Z"


def _read(path: Path) -> NDArray[Any]:
    shape = _check_header(path, read_bounded(path))
    try:
        with OpenEXR.File(str(path), separate_channels=True, num_threads=0) as file:
            planes = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    except (RuntimeError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise FormatError(f"{path}: is a damaged EXR file: {shortened(str(error), 150)}") from error
    if any(plane.shape != shape for plane in planes.values()):
        raise FormatError(f"{path}: its channels do not have the size its header declares")
    first, *others = planes.values()
    if _DEPTH in planes:
        raise FormatError(f"{path}: holds a depth (channel {_DEPTH}), not a disparity")
    if not all(np.array_equal(first, other, equal_nan=True) for other in others):
        raise FormatError(f"{path}: has the channels {listed(list(planes))}, a disparity has one")
    return first


def _check_header(path: Path, data: bytes) -> tuple[int, int]:
    """The (height, width) that the header declares."""
    if not data.startswith(_MAGIC) or len(data) < 8:
        raise FormatError(f"{path}: is not an EXR file, its signature is missing")
    if struct.unpack_from("<I", data, 4)[0] & (_DEEP | _PARTS):
        raise FormatError(
            f"{path}: is an EXR file of several parts or of deep pixels, a disparity is one image"
        )
    try:
        attributes = _attributes(data)
        x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
        channels = _count_channels(attributes["channels"])
    except (KeyError, ValueError, struct.error) as error:
        raise FormatError(f"{path}: is an EXR file whose header does not parse") from error
    check_image_size(path, x1 - x0 + 1, y1 - y0 + 1, channels)
    return y1 - y0 + 1, x1 - x0 + 1


def _count_channels(channels: bytes) -> int:
    """How many names, each with 16 bytes behind it, a list of channels has; ValueError for a damaged one."""
    count = position = 0
    while channels[position : position + 1] != b"\0":
        position = channels.index(b"\0", position) + 17
        count += 1
    return count


def _attributes(data: bytes) -> dict[str, bytes]:
    """The header's attributes by name. Raises ValueError or struct.error for a damaged header."""
    attributes: dict[str, bytes] = {}
    position = 8
    while data[position : position + 1] != b"\0":
        name_end = data.index(b"\0", position, position + 256)
        type_end = data.index(b"\0", name_end + 1, name_end + 257)
        (size,) = struct.unpack_from("<I", data, type_end + 1)
        attributes[data[position:name_end].decode("latin-1")] = data[type_end + 5 : type_end + 5 + size]
        position = type_end + 5 + size
    return attributes


def _write(path: Path, disparity: NDArray[np.float32], units_per_px: float | None) -> None:
    write_channels(path, {_CHANNEL: in_floats(disparity, units_per_px)})


FORMAT = DisparityFormat("an .exr", (".exr",), _read, _write)

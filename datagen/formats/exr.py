"""OpenEXR files of float32 channels: scan lines from the top down, ZIP compression, one part.

OpenEXR's reader trusts a file and allocates what its header declares. So the header and the table of chunks are
first compared with the exact layout that `write_channels` makes (openexr.com/en/latest/OpenEXRFileLayout.html).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.limits import check_image_size, read_bounded
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import replacing
from stereoforge_kit.messages import shortened

_MAGIC_AND_VERSION = struct.pack("<II", 20000630, 2)
"""Version 2 with no flag set: one part, scan lines, short names, no deep data."""
_ZIP = 3
_LINES_PER_CHUNK = 16
_FLOAT = 2
_INCREASING_Y = 0
_ATTRIBUTE_TYPES = {
    "channels": "chlist",
    "compression": "compression",
    "dataWindow": "box2i",
    "displayWindow": "box2i",
    "lineOrder": "lineOrder",
    "pixelAspectRatio": "float",
    "screenWindowCenter": "v2f",
    "screenWindowWidth": "float",
    "type": "string",
}
"""All attributes that such a file needs. OpenEXR only prints warnings about others, which cannot become errors."""


def read_channels(path: Path, names: tuple[str, ...]) -> dict[str, NDArray[np.float32]]:
    """Read a file that has exactly these channels.

    Args:
        path: An EXR file as `write_channels` writes it.
        names: The channels in alphabetical order, which is their order in a file.

    Returns:
        Each channel, (H, W) float32, by its name.

    Raises:
        FormatError: For a file that is missing, damaged or of another layout.
    """
    data = read_bounded(path)
    width, height = _check_layout(path, data, names)
    try:
        with OpenEXR.File(str(path), separate_channels=True, num_threads=0) as file:
            planes = {name: np.array(file.channels()[name].pixels) for name in names}
    except (RuntimeError, ValueError, TypeError, KeyError) as error:
        raise FormatError(f"{path}: is a damaged EXR file: {shortened(str(error), 150)}") from error
    if any(plane.shape != (height, width) or plane.dtype != np.float32 for plane in planes.values()):
        raise FormatError(f"{path}: its channels do not have the size its header declares")
    return planes


def write_channels(path: Path, planes: Mapping[str, NDArray[Any]]) -> None:
    """Write channels, each (H, W) and stored as float32, by their names in alphabetical order.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "planes.exr"
    ...     write_channels(path, {"x": np.ones((2, 3)), "y": np.zeros((2, 3))})
    ...     planes = read_channels(path, ("x", "y"))
    >>> planes["x"].shape, planes["x"].dtype.name, planes["y"].max().item()
    ((2, 3), 'float32', 0.0)
    """
    channels = {name: np.ascontiguousarray(plane, np.float32) for name, plane in planes.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with replacing(path) as temporary:
        OpenEXR.File(header, channels, num_threads=0).write(str(temporary))


def _check_layout(path: Path, data: bytes, names: tuple[str, ...]) -> tuple[int, int]:
    """Check all that is not pixels; return (width, height)."""
    if not data.startswith(_MAGIC_AND_VERSION):
        raise FormatError(f"{path}: is not an EXR file of one part of scan lines")
    try:
        attributes, table = _parse_attributes(data)
        _check_channels(path, attributes["channels"], names)
        x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
        encoding = (attributes["compression"], attributes["lineOrder"])
    except (KeyError, ValueError, struct.error) as error:
        raise FormatError(f"{path}: is an EXR file whose header does not parse ({error})") from error
    if encoding != (bytes([_ZIP]), bytes([_INCREASING_Y])):
        raise FormatError(f"{path}: is not an EXR file of ZIP-compressed lines from the top down")
    width, height = x1 - x0 + 1, y1 - y0 + 1
    check_image_size(path, width, height, len(names))
    _check_chunks(path, data, table, 4 * width * len(names), y0, height)
    return width, height


def _parse_attributes(data: bytes) -> tuple[dict[str, bytes], int]:
    """The header's attributes by name, and where the table of chunks begins. Raises ValueError for a damaged header."""
    attributes: dict[str, bytes] = {}
    position = len(_MAGIC_AND_VERSION)
    while data[position : position + 1] != b"\0":
        name_end = data.index(b"\0", position, position + 32)
        type_end = data.index(b"\0", name_end + 1, name_end + 33)
        (size,) = struct.unpack_from("<I", data, type_end + 1)
        end = type_end + 5 + size
        name, kind = data[position:name_end].decode("ascii"), data[name_end + 1 : type_end].decode("ascii")
        if _ATTRIBUTE_TYPES.get(name) != kind or name in attributes or end >= len(data):
            raise InputError(f"attribute {name!r} is unknown, repeated or too long")
        attributes[name] = data[type_end + 5 : end]
        position = end
    return attributes, position + 1


def _check_channels(path: Path, channel_list: bytes, names: tuple[str, ...]) -> None:
    """Require exactly these channels, all float32 at full resolution."""
    expected = b"".join(
        name.encode("ascii") + b"\0" + struct.pack("<iB3xii", _FLOAT, 0, 1, 1) for name in names
    )
    if channel_list != expected + b"\0":
        raise FormatError(f"{path}: is not an EXR file of the float channels {', '.join(names)}")


def _check_chunks(path: Path, data: bytes, table: int, line_bytes: int, top: int, height: int) -> None:
    """Require the chunks to lie in the file one after the other, and to end where the file ends."""
    count = -(-height // _LINES_PER_CHUNK)
    position = table + 8 * count
    if position > len(data):
        raise FormatError(f"{path}: is an EXR file cut off after {len(data)} bytes")
    for index, offset in enumerate(struct.unpack_from(f"<{count}Q", data, table)):
        lines = min(_LINES_PER_CHUNK, height - index * _LINES_PER_CHUNK)
        if offset != position or position + 8 > len(data):
            raise FormatError(
                f"{path}: is an EXR file whose chunk {index} of {count} is not where it should be"
            )
        line, size = struct.unpack_from("<ii", data, position)
        raw_size = lines * line_bytes
        if line != top + index * _LINES_PER_CHUNK or not 0 < size <= raw_size:
            raise FormatError(f"{path}: is an EXR file whose chunk {index} of {count} has a damaged head")
        position += 8 + size
        if size < raw_size and not _inflates(data[position - size : position], raw_size):
            raise FormatError(f"{path}: is an EXR file whose chunk {index} of {count} does not decompress")
    if position != len(data):
        raise FormatError(f"{path}: has {len(data)} bytes where its chunks end at {position}")


def _inflates(packed: bytes, raw_size: int) -> bool:
    """Whether a chunk is one zlib stream of the right size and checksum.

    OpenEXR would only print a warning and return no pixels. A chunk that compression does not shrink is stored raw.
    """
    stream = zlib.decompressobj()
    try:
        # One byte more than there should be, so that the stream's checksum is read too.
        raw = stream.decompress(packed, raw_size + 1)
    except zlib.error:
        return False
    return len(raw) == raw_size and stream.eof

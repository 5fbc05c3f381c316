"""The image files of other people's data sets: PNG, JPEG and the portable maps PGM and PPM."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.limits import check_image_size, read_bounded
from datagen.formats.png import read_png

_PNM_HEADER = re.compile(rb"P([56])(?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s+(\d{1,5})\s")
_JPEG_STANDALONE = {0x01, *range(0xD0, 0xD8)}
_JPEG_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_MOST_JPEG_SEGMENTS = 100_000
"""Fill bytes count as one segment each."""
_JPEG_END = b"\xff\xd9"


def read_picture(path: Path | str) -> NDArray[np.uint8]:
    """Read an image as (H, W, 3) uint8 RGB: grey is repeated, alpha dropped, 16 bits are scaled to 8.

    Raises FormatError for a file that is missing, damaged, or none of PNG, JPEG, PGM and PPM.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "grey.pgm"
    ...     _ = path.write_bytes(b"P5 2 1 255\\n" + bytes([7, 200]))
    ...     image = read_picture(path)
    >>> image.tolist()
    [[[7, 7, 7], [200, 200, 200]]]
    """
    path = Path(path)
    pixels = read_jpeg(path) if path.suffix.lower() in (".jpg", ".jpeg") else read_raster(path)
    if pixels.dtype == np.uint16:
        pixels = np.rint(pixels / 257.0).astype(np.uint8)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    return np.ascontiguousarray(pixels[..., :3], np.uint8)


def read_raster(path: Path | str) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Read the numbers of a PNG, PGM or PPM file unchanged: (H, W) or (H, W, C), uint8 or uint16.

    Raises FormatError for a file that is missing, damaged or none of these.
    """
    path = Path(path)
    return read_pnm(path) if path.suffix.lower() in (".pgm", ".ppm") else read_png(path)


def read_pnm(path: Path | str) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Read a binary PGM file, (H, W), or PPM file, (H, W, 3), as uint8 or uint16.

    16-bit numbers are big endian in these files (netpbm.sourceforge.net/doc/pgm.html). Raises FormatError for a
    file that is missing, damaged or neither.
    """
    path = Path(path)
    data = read_bounded(path)
    header = _PNM_HEADER.match(data)
    if header is None:
        raise FormatError(f"{path}: is not a binary PGM or PPM file, its header does not parse")
    channels = 1 if header[1] == b"5" else 3
    width, height, largest = int(header[2]), int(header[3]), int(header[4])
    check_image_size(path, width, height, channels)
    if not 0 < largest < 2**16:
        raise FormatError(f"{path}: its header declares {largest} as the largest value, not 1 to 65535")
    kind = np.dtype("u1") if largest < 256 else np.dtype(">u2")
    expected = header.end() + width * height * channels * kind.itemsize
    if len(data) != expected:
        raise FormatError(f"{path}: has {len(data)} bytes where its header promises {expected}")
    values = np.frombuffer(data, kind, offset=header.end())
    values = values.reshape((height, width) if channels == 1 else (height, width, channels))
    return values.astype(np.uint8) if kind.itemsize == 1 else values.astype(np.uint16)


def read_jpeg(path: Path | str) -> NDArray[np.uint8]:
    """Read a JPEG file as (H, W, 3) uint8 RGB. Raises FormatError for a file that is missing, damaged or none."""
    path = Path(path)
    data = read_bounded(path)
    check_image_size(path, *_jpeg_size(path, data), channels=3)
    if _JPEG_END not in data[-64:]:
        raise FormatError(f"{path}: is a JPEG file cut off after {len(data)} bytes")
    image: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise FormatError(f"{path}: is a JPEG file whose pixels do not decode")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))


def _jpeg_size(path: Path, data: bytes) -> tuple[int, int]:
    """(width, height) from the frame header, found by walking the segments before it."""
    position = 2
    if not data.startswith(b"\xff\xd8"):
        raise FormatError(f"{path}: is not a JPEG file")
    segments = 0
    while position + 9 <= len(data) and data[position] == 0xFF and segments < _MOST_JPEG_SEGMENTS:
        segments += 1
        marker = data[position + 1]
        if marker in _JPEG_FRAMES:
            height, width = struct.unpack_from(">HH", data, position + 5)
            return width, height
        if marker in _JPEG_STANDALONE or marker == 0xFF:
            position += 1 if marker == 0xFF else 2
        else:
            position += 2 + struct.unpack_from(">H", data, position + 2)[0]
    raise FormatError(f"{path}: is a JPEG file without a frame header")

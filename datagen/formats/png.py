"""PNG images of 8 or 16 bits (ISO/IEC 15948): colours, occlusion labels and object indices."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.limits import MAX_ELEMENTS, check_image_size, read_bounded, require_regular
from stereoforge_kit.files import write_bytes

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COMPRESSION_LEVEL = 1
"""Level 1 writes a rendered 960x540 frame three times as fast as level 6 and 3 % larger."""


def read_png(path: Path | str) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Read a PNG file: (H, W) grey, (H, W, 3) RGB or (H, W, 4) RGB with alpha; uint8 or uint16.

    Every chunk's checksum is compared, so a change of any byte is found. Raises FormatError for a file that is
    missing, damaged, animated or no PNG file. `write_png` has an example.
    """
    return decode_png(read_bounded(Path(path)), str(path))


def decode_png(data: bytes, origin: str, most: int = MAX_ELEMENTS) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Decode the content of a PNG file of at most so many numbers as `read_png` does; `origin` names it in errors."""
    _check_chunks(origin, data, most)
    image: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FormatError(f"{origin}: is a PNG file whose pixels do not decode")
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2RGB if image.shape[2] == 3 else cv2.COLOR_BGRA2RGBA)
    return np.asarray(image)


def read_png_size(path: Path | str) -> tuple[int, int]:
    """Read only the header of a PNG file: (height, width) in pixels. Raises FormatError as `read_png` does."""
    path = Path(path)
    try:
        require_regular(path)
        with path.open("rb") as file:
            start = file.read(len(_SIGNATURE) + 16)
    except OSError as error:
        raise FormatError(f"{path}: cannot be read: {error.strerror}") from error
    if len(start) < len(_SIGNATURE) + 16 or not start.startswith(_SIGNATURE + b"\0\0\0\rIHDR"):
        raise FormatError(f"{path}: is not a PNG file, it does not begin with an image header")
    width, height = struct.unpack_from(">II", start, len(_SIGNATURE) + 8)
    check_image_size(path, width, height, channels=4)
    return height, width


def write_png(path: Path | str, array: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """Write (H, W) grey or (H, W, 3) RGB values of type uint8 or uint16.

    Raises FormatError for an array of another shape or type, or an empty one.

    >>> import tempfile
    >>> object_index = np.array([[0, 1], [2, 40_000]], np.uint16)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "object_index.png"
    ...     write_png(path, object_index)
    ...     size, again = read_png_size(path), read_png(path)
    >>> size, again.dtype.name, again.tolist()
    ((2, 2), 'uint16', [[0, 1], [2, 40000]])
    """
    path = Path(path)
    shape_fits = array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)
    if array.size == 0 or not shape_fits or array.dtype not in (np.uint8, np.uint16):
        raise FormatError(
            f"{path}: a PNG file holds (H, W) or (H, W, 3) values of uint8 or uint16, "
            f"not {array.shape} of {array.dtype}"
        )
    image = array if array.ndim == 2 else cv2.cvtColor(array, cv2.COLOR_RGB2BGR)
    encoded, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, _COMPRESSION_LEVEL])
    if not encoded:
        raise FormatError(f"{path}: {array.shape} values of {array.dtype} could not be encoded as PNG")
    write_bytes(path, data.tobytes())


def _check_chunks(origin: str, data: bytes, most: int) -> None:
    """Walk the chunks: signature, bounded image header, checksums, an end, and nothing after it."""
    if not data.startswith(_SIGNATURE):
        raise FormatError(f"{origin}: is not a PNG file, its signature is missing")
    position, name = len(_SIGNATURE), b""
    while name != b"IEND":
        if position + 12 > len(data):
            raise FormatError(f"{origin}: is a PNG file cut off after {len(data)} bytes")
        length, name = struct.unpack_from(">I4s", data, position)
        end = position + 12 + length
        if end > len(data):
            raise FormatError(f"{origin}: is a PNG file cut off after {len(data)} bytes")
        if zlib.crc32(data[position + 4 : end - 4]) != struct.unpack_from(">I", data, end - 4)[0]:
            raise FormatError(
                f"{origin}: is a damaged PNG file, the checksum at byte {end - 4} does not match"
            )
        if (position == len(_SIGNATURE)) != (name == b"IHDR"):
            raise FormatError(f"{origin}: is a PNG file that does not begin with its one image header")
        if name == b"IHDR":
            _check_header(origin, data[position + 8 : end - 4], most)
        if name in (b"acTL", b"fcTL", b"fdAT"):
            raise FormatError(f"{origin}: is an animated PNG file, not one image")
        position = end
    if position != len(data):
        raise FormatError(f"{origin}: is a PNG file with {len(data) - position} bytes after its end")


def _check_header(origin: str, header: bytes, most: int) -> None:
    if len(header) != 13:
        raise FormatError(f"{origin}: is a PNG file whose image header has {len(header)} bytes, not 13")
    width, height = struct.unpack_from(">II", header)
    check_image_size(origin, width, height, channels=4, most=most)

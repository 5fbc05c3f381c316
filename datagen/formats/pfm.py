"""Portable float maps (PFM): the disparity files of FlyingThings3D, Middlebury and ETH3D.

A text header gives the number of channels (`Pf` one, `PF` three), the width and height, and a scale whose sign tells
the byte order (negative for little endian). Float32 rows follow, from the bottom of the image to the top. The format
is Paul Debevec's (pauldebevec.com/Research/HDR/PFM). As other readers do, these take lines that end in CRLF or have
spaces at their end, comments as in PGM files, and a line end after the last number.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.limits import check_image_size, read_bounded
from stereoforge_kit.files import write_bytes

_GAP = rb"(?:\s|#[^\n]{0,1000}\n){1,64}"
_HEADER = re.compile(rb"(P[fF])%b(\d{1,9})%b(\d{1,9})%b(\S{1,32})(?=\s)" % (_GAP, _GAP, _GAP))
_ENDS_OF_HEADER = tuple(
    map(
        re.compile,
        (rb"[ \t]{0,64}(?:#[^\n]{0,1000})?\r?\n", rb"\s", rb"[ \t]{0,64}\r?\n#[^\n]{0,1000}\n"),
    )
)
"""What other programs put between the scale and the numbers: the end of the line, one white space, a comment too. The
first that leaves the right number of bytes is taken, since a number's first byte may look like white space."""
_AFTER_NUMBERS = (b"", b"\n", b"\r\n")


def read_pfm(path: Path | str) -> NDArray[np.float32]:
    """Read a float map: (H, W) or (H, W, 3) float32, row 0 at the top.

    The scale's magnitude is not applied: Middlebury writes 1/255 there, though its disparities are in pixels
    already, and no stereo benchmark's reader multiplies by it. Raises FormatError for a file that is missing,
    damaged or no PFM file. `write_pfm` has an example.
    """
    return decode_pfm(read_bounded(Path(path)), str(path))


def decode_pfm(data: bytes, origin: str) -> NDArray[np.float32]:
    """Decode the content of a PFM file as `read_pfm` does; `origin` names the file in errors.

    >>> decode_pfm(b"Pf 2 1 -1 " + np.array([1.5, 2.5], "<f4").tobytes(), "tiny.pfm").tolist()
    [[1.5, 2.5]]
    """
    header = _HEADER.match(data)
    if header is None:
        raise FormatError(f"{origin}: is not a PFM file, its header does not parse")
    kind, width, height, channels = header[1], int(header[2]), int(header[3]), 3 if header[1] == b"PF" else 1
    check_image_size(origin, width, height, channels)
    scale = _parse_scale(origin, header[4])
    start = _first_number(origin, data, header.end(), 4 * width * height * channels)
    values = np.frombuffer(data, "<f4" if scale < 0 else ">f4", width * height * channels, start)
    rows = values.reshape((height, width, 3) if kind == b"PF" else (height, width))
    return np.ascontiguousarray(rows[::-1], np.float32)


def read_pfm_disparity(path: Path | str) -> NDArray[np.float32]:
    """Read a disparity: (H, W) float32 px, the first of three channels if they are alike, as some programs write them.

    Raises FormatError as `read_pfm` does, and for three channels that differ.
    """
    return first_channel(read_pfm(path), str(path))


def first_channel(array: NDArray[np.float32], origin: str) -> NDArray[np.float32]:
    """(H, W) of (H, W) or of (H, W, 3) with three equal channels; `origin` names the file in errors.

    Raises FormatError for channels that differ.
    """
    if array.ndim == 2:
        return array
    first = array[..., 0]
    if not all(np.array_equal(first, array[..., other], equal_nan=True) for other in (1, 2)):
        raise FormatError(f"{origin}: has three channels that differ, a disparity has one")
    return np.ascontiguousarray(first)


def write_pfm(path: Path | str, array: NDArray[np.floating[Any]]) -> None:
    """Write (H, W) or (H, W, 3) numbers, row 0 at the top, as little-endian float32 of scale -1.

    Raises FormatError for an array of another shape, or an empty one.

    >>> import tempfile
    >>> disparity = np.array([[10.5, np.nan], [0.0, 3.25]], np.float32)  # In pixels; NaN is invalid.
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "disparity.pfm"
    ...     write_pfm(path, disparity)
    ...     again = read_pfm(path)
    >>> again.tolist()
    [[10.5, nan], [0.0, 3.25]]
    """
    path = Path(path)
    if array.size == 0 or not (array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)):
        raise FormatError(f"{path}: a PFM file holds (H, W) or (H, W, 3) numbers, not {array.shape}")
    kind = "PF" if array.ndim == 3 else "Pf"
    header = f"{kind}\n{array.shape[1]} {array.shape[0]}\n-1.0\n".encode("ascii")
    write_bytes(path, header + np.ascontiguousarray(array[::-1], "<f4").tobytes())


def _first_number(origin: str, data: bytes, after_scale: int, size: int) -> int:
    """Where the numbers begin, of which there are `size` bytes."""
    for pattern in _ENDS_OF_HEADER:
        gap = pattern.match(data, after_scale)
        if gap and any(
            len(data) == gap.end() + size + len(end) and data.endswith(end) for end in _AFTER_NUMBERS
        ):
            return gap.end()
    raise FormatError(f"{origin}: has {len(data)} bytes where its header promises {after_scale + 1 + size}")


def _parse_scale(origin: str, word: bytes) -> float:
    try:
        scale = float(word)
    except ValueError:
        scale = math.nan
    if not math.isfinite(scale) or scale == 0:
        raise FormatError(f"{origin}: the scale in its header is {word!r}, which gives no byte order")
    return scale

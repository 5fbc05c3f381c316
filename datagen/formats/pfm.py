"""Portable float maps (PFM): the disparity files of FlyingThings3D, Middlebury and ETH3D.

A text header gives the number of channels (`Pf` one, `PF` three), the width and height, and a scale whose sign tells
the byte order (negative for little endian). Float32 rows follow, from the bottom of the image to the top. The format
is Paul Debevec's (pauldebevec.com/Research/HDR/PFM).
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

_HEADER = re.compile(rb"(P[fF])\s{1,8}(\d{1,9})\s{1,8}(\d{1,9})\s{1,8}(\S{1,32})\s")


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
    expected = header.end() + 4 * width * height * channels
    if len(data) != expected:
        raise FormatError(f"{origin}: has {len(data)} bytes where its header promises {expected}")
    values = np.frombuffer(data, "<f4" if scale < 0 else ">f4", offset=header.end())
    rows = values.reshape((height, width, 3) if kind == b"PF" else (height, width))
    return np.ascontiguousarray(rows[::-1], np.float32)


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


def _parse_scale(origin: str, word: bytes) -> float:
    try:
        scale = float(word)
    except ValueError:
        scale = math.nan
    if not math.isfinite(scale) or scale == 0:
        raise FormatError(f"{origin}: the scale in its header is {word!r}, which gives no byte order")
    return scale

"""TIFF files of one grey channel: 32-bit floating pixels, or 16 bits as in KITTI's PNG files.

Pillow reads the header, so that its size is known before memory is allocated; OpenCV decodes the numbers.
"""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from datagen.errors import FormatError
from datagen.formats.disparity.meaning import PNG_UNITS_PER_PX, in_floats, to_units
from datagen.formats.disparity.record import DisparityFormat
from datagen.formats.limits import check_image_size, read_bounded
from stereoforge_kit.files import write_bytes

_SIGNATURES = (b"II*\0", b"MM\0*")
_WIDTH, _HEIGHT, _CHANNELS = 256, 257, 277
"""Tags of TIFF."""
_LZW = [cv2.IMWRITE_TIFF_COMPRESSION, 5]


def _read(path: Path) -> NDArray[Any]:
    data = read_bounded(path)
    _check_header(path, data)
    values: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if values is None:
        raise FormatError(f"{path}: is a TIFF file whose numbers do not decode, or a damaged one")
    return np.asarray(values)


def _check_header(path: Path, data: bytes) -> None:
    if data[:4] not in _SIGNATURES:
        raise FormatError(f"{path}: is not a TIFF file, its signature is missing")
    file = io.BytesIO(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Of odd metadata.
            tags = ImageFileDirectory_v2(file.read(8))
            file.seek(tags.next)
            tags.load(file)
        width, height = int(tags[_WIDTH]), int(tags[_HEIGHT])
        channels = int(tags.get(_CHANNELS, 1))
    except Exception as error:  # Pillow raises whatever a damaged directory leads to.
        raise FormatError(f"{path}: is a TIFF file whose header does not parse") from error
    check_image_size(path, width, height, channels)
    if channels != 1:
        raise FormatError(f"{path}: has {channels} channels, a disparity has one")
    if tags.next:
        raise FormatError(f"{path}: holds several pictures, a disparity is one")


def _write(path: Path, disparity: NDArray[np.float32], units_per_px: float | None) -> None:
    values = in_floats(disparity, None) if units_per_px is None else to_units(disparity, units_per_px, path)
    encoded, data = cv2.imencode(".tiff", values, _LZW)
    if not encoded:
        raise FormatError(f"{path}: {disparity.shape} numbers could not be encoded as TIFF")
    write_bytes(path, data.tobytes())


FORMAT = DisparityFormat("a .tiff", (".tiff", ".tif"), _read, _write, PNG_UNITS_PER_PX)

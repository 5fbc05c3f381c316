"""Masks as binary portable grey maps (PGM, `P5`, 8 bits) of 0 and 255, as FlyingThings3D's motion boundaries."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.limits import check_image_size, read_bounded
from stereoforge_kit.files import write_bytes

_HEADER = re.compile(rb"P5\s{1,8}(\d{1,9})\s{1,8}(\d{1,9})\s{1,8}255\s")


def read_mask(path: Path | str) -> NDArray[np.bool_]:
    """Read an (H, W) bool mask, True where the grey is 255.

    Raises FormatError for a file that is missing, damaged, no 8-bit PGM file, or has greys other than 0 and 255.
    `write_mask` has an example.
    """
    path = Path(path)
    data = read_bounded(path)
    header = _HEADER.match(data)
    if header is None:
        raise FormatError(f"{path}: is not an 8-bit PGM file, its header does not parse")
    width, height = int(header[1]), int(header[2])
    check_image_size(path, width, height, channels=1)
    if len(data) != header.end() + width * height:
        expected = header.end() + width * height
        raise FormatError(f"{path}: has {len(data)} bytes where its header promises {expected}")
    greys = np.frombuffer(data, np.uint8, offset=header.end()).reshape(height, width)
    if not np.isin(greys, (0, 255)).all():
        raise FormatError(f"{path}: has greys other than 0 and 255, so it is no mask")
    return greys == 255


def write_mask(path: Path | str, mask: NDArray[np.bool_]) -> None:
    """Write an (H, W) bool mask. Raises FormatError for an array of another shape or type.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "motion_boundaries.pgm"
    ...     write_mask(path, np.array([[True, False]]))
    ...     content, again = path.read_bytes(), read_mask(path)
    >>> content, again.tolist()
    (b'P5\\n2 1\\n255\\n\\xff\\x00', [[True, False]])
    """
    path = Path(path)
    if mask.ndim != 2 or mask.size == 0 or mask.dtype != np.bool_:
        raise FormatError(f"{path}: a mask is (H, W) bool, not {mask.shape} of {mask.dtype}")
    header = f"P5\n{mask.shape[1]} {mask.shape[0]}\n255\n".encode("ascii")
    write_bytes(path, header + np.where(mask, np.uint8(255), np.uint8(0)).tobytes())

"""Reading untrusted files: sizes are checked before memory is allocated."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from datagen.errors import FormatError

MAX_ELEMENTS = 2**28
"""Most numbers an array may have, 1 GiB of float32. A header that promises more is damaged."""
MAX_ELEMENTS_TO_REDUCE = 2**30
"""Most numbers of 8 or 16 bits that a picture may have that is made smaller as soon as it is decoded."""
MAX_FILE_BYTES = 2**31
"""Largest file that is read."""
MAX_JSON_BYTES = 2**25
"""Largest JSON file that is read. Parsed, JSON takes up to twenty times its size; no record comes near this limit."""


def read_bounded(path: Path, most_bytes: int = MAX_FILE_BYTES) -> bytes:
    """The whole content of a file.

    Raises FormatError for a file that cannot be read, is no regular file, or is larger than `most_bytes`.
    """
    try:
        size = require_regular(path).st_size
        if size > most_bytes:
            raise FormatError(f"{path}: {size} bytes are more than any such file of a data set has")
        return path.read_bytes()
    except OSError as error:
        raise FormatError(f"{path}: cannot be read: {error.strerror}") from error


def require_regular(path: Path) -> os.stat_result:
    """The status of a regular file.

    Raises FormatError for a pipe or a device, which would be read without end, and OSError for no file at all.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise FormatError(f"{path}: cannot be read: it is no regular file")
    return status


def check_image_size(
    origin: Path | str, width: int, height: int, channels: int, most: int = MAX_ELEMENTS
) -> None:
    """Raise FormatError, naming `origin`, for an image that is empty or has more than `most` numbers."""
    if width <= 0 or height <= 0:
        raise FormatError(f"{origin}: its header declares an image of {width} x {height} pixels")
    if width * height * channels > most:
        raise FormatError(
            f"{origin}: its header declares {width} x {height} pixels of {channels} channels, "
            f"more than the {most} numbers allowed"
        )

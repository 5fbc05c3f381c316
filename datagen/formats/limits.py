"""Reading bytes from a file nobody vouches for: sizes are checked before memory is taken."""

from __future__ import annotations

from pathlib import Path

from datagen.errors import FormatError

MAX_ELEMENTS = 2**28
"""Most numbers an array may have, 1 GiB of float32: a header that promises more is damage, not data."""
MAX_FILE_BYTES = 2**31


def read_bounded(path: Path) -> bytes:
    """The whole content of a file. Raises FormatError if it cannot be read or is beyond any image's size."""
    try:
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            raise FormatError(f"{path}: {size} bytes are more than any file of a data set has")
        return path.read_bytes()
    except OSError as error:
        raise FormatError(f"{path}: cannot be read: {error.strerror}") from error


def check_image_size(origin: Path | str, width: int, height: int, channels: int) -> None:
    """Raise FormatError unless an image of this size is not empty and within `MAX_ELEMENTS`."""
    if width <= 0 or height <= 0:
        raise FormatError(f"{origin}: its header declares an image of {width} x {height} pixels")
    if width * height * channels > MAX_ELEMENTS:
        raise FormatError(
            f"{origin}: its header declares {width} x {height} pixels of {channels} channels, "
            f"more than the {MAX_ELEMENTS} numbers allowed"
        )

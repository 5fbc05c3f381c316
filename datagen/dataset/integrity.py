"""Comparing files with the sizes and SHA-256 that a manifest or an index has for them."""

from __future__ import annotations

import errno
import hashlib
import io

from datagen.dataset.layout import Layout
from datagen.dataset.manifest import FileEntry


def compare(layout: Layout, entry: FileEntry) -> tuple[int, str | None]:
    """Read a file of a data set and compare it with its entry in the manifest.

    Returns:
        The number of bytes read, and what is wrong as the end of a sentence ("is damaged, ..."), or None.
    """
    path = layout.root / entry.path
    try:
        if path.exists() and not path.is_file():  # A pipe or a device would be read without end.
            raise OSError(errno.EINVAL, "it is no regular file")
        with layout.local(path).open("rb") as file:
            return compare_open(file, entry)
    except OSError as error:
        return 0, f"cannot be read: {error.strerror}"


def compare_open(file: io.BufferedIOBase, entry: FileEntry) -> tuple[int, str | None]:
    """`compare` for a file that is open at its beginning. Raises OSError if it cannot be read."""
    digest = hashlib.file_digest(file, "sha256").hexdigest()
    size = file.tell()
    if size != entry.size:
        return size, f"has {size} bytes where the manifest has {entry.size}"
    if digest != entry.sha256:
        return size, "is damaged, its SHA-256 is not the manifest's"
    return size, None

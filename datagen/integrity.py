"""Whether files are what was written down of them: their sizes and SHA-256."""

from __future__ import annotations

import errno
import hashlib
import io
from collections.abc import Iterable, Iterator

from datagen.dataset import StereoSample
from datagen.errors import DatasetError
from datagen.layout import Layout
from datagen.manifest import FileEntry, read_manifest


def compare(layout: Layout, entry: FileEntry) -> tuple[int, str | None]:
    """Read a file of a data set: its bytes, and half a sentence if it is not the one that the entry describes."""
    path = layout.root / entry.path
    try:
        if path.exists() and not path.is_file():  # A pipe or a device would be read without end.
            raise OSError(errno.EINVAL, "it is no regular file")
        with layout.local(path).open("rb") as file:
            return compare_open(file, entry)
    except OSError as error:
        return 0, f"cannot be read: {error.strerror}"


def compare_open(file: io.BufferedIOBase, entry: FileEntry) -> tuple[int, str | None]:
    """As `compare`, of a file that is open at its beginning. Raises OSError if it cannot be read."""
    digest = hashlib.file_digest(file, "sha256").hexdigest()
    size = file.tell()
    if size != entry.size:
        return size, f"has {size} bytes where the manifest has {entry.size}"
    if digest != entry.sha256:
        return size, "is damaged, its SHA-256 is not the manifest's"
    return size, None


def intact(samples: Iterable[StereoSample]) -> Iterator[StereoSample]:
    """The same samples, each scene's files compared with its manifest before its first one.

    For whoever copies a data set: damage that travels into a copy can no longer be told from data. Raises
    DatasetError, naming the first damaged file.
    """
    last = None
    for sample in samples:
        layout, scene = sample.layout, (sample.split, sample.scene)
        if scene != last:
            for entry in read_manifest(layout.local(layout.manifest(*scene))).files:
                _, problem = compare(layout, entry)
                if problem:
                    raise DatasetError(
                        f"{layout.root / entry.path}: {problem}; verify --repair renders it again"
                    )
            last = scene
        yield sample

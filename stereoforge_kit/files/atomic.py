"""Writing files so that no reader, and no crash, ever leaves half of one behind."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stereoforge_kit.errors import InputError

TEMPORARY_SUFFIX = ".tmp"


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` that takes its place on success and is removed on failure.

    Parent folders are made. The name starts with a dot and ends in `TEMPORARY_SUFFIX`, so that what a
    killed process leaves is recognisable; process and thread in it keep two writers of one file apart.

    Raises InputError for a device or a pipe: it would be gone, for every other program too.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path}: is a device or a pipe, which no file may replace")
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}{TEMPORARY_SUFFIX}")
    try:
        yield temporary
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_bytes(path: Path, data: bytes) -> None:
    """Replace the whole content of `path` in one step."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """Replace the whole content of `path` by UTF-8 text with Unix line ends in one step."""
    write_bytes(path, text.encode("utf-8"))

"""Where temporary files go when only --out can be written, as in a container whose image is read-only."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from stereoforge_kit.files import TemporaryFolders, temporary_files_in
from stereoforge_kit.messages import shortened

OUT_FLAG = "--out"
FOLDER = ".temporary"
_FILES = (".html", ".json", ".png")
"""What commands write that write no folder."""
_CACHES = ("NUMBA_CACHE_DIR", "MPLCONFIGDIR")


@contextmanager
def temporary_files_in_out(words: Sequence[str]) -> Iterator[None]:
    """Let a command put its temporary files into a hidden folder of what --out names, if there is no other place.

    words: The command line. Without --out, or with a URL, nothing is changed.
    """
    out = _out(words)
    if out is None or "://" in out or _has_place():
        yield
        return
    place = Path(out).resolve()
    place = place.parent if place.suffix in _FILES else place
    made = not place.exists()
    try:
        with TemporaryFolders(place / FOLDER).new() as folder, temporary_files_in(folder), _caches_in(folder):
            print(
                f"stereoforge: only {OUT_FLAG} can be written: temporary files go to {shortened(str(folder), 100)}, "
                "and every start compiles anew (TMPDIR names another place)",
                file=sys.stderr,
            )
            yield
    finally:
        if made and place.is_dir() and not any(place.iterdir()):
            place.rmdir()


@contextmanager
def _caches_in(folder: Path) -> Iterator[None]:
    """Let libraries that say so, or fail, where they cannot write their caches have a place for them."""
    missing = [name for name in _CACHES if name not in os.environ]
    os.environ.update(dict.fromkeys(missing, str(folder)))
    try:
        yield
    finally:
        for name in missing:
            del os.environ[name]


def _has_place() -> bool:
    try:
        tempfile.gettempdir()
    except FileNotFoundError:
        return False
    return True


def _out(words: Sequence[str]) -> str | None:
    for word, following in zip(words, [*words[1:], ""], strict=True):
        if word == OUT_FLAG and following:
            return following
        if word.startswith(f"{OUT_FLAG}="):
            return word.removeprefix(f"{OUT_FLAG}=")
    return None

"""Walking folders of other people's files: links are followed, and what desktops leave behind is no data."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePath

from stereoforge_kit.errors import InputError
from stereoforge_kit.files.atomic import TEMPORARY_SUFFIX

_LEFT_BY_DESKTOPS = {"thumbs.db", "ehthumbs.db", "desktop.ini", "__macosx"}


def is_data(name: PurePath | str) -> bool:
    """Whether a relative path is data: neither hidden nor left by a desktop, and in no such folder.

    The temporary file that a killed writer of ours leaves counts, so that a check finds it.

    >>> is_data("left/0000.png"), is_data("left/._0000.png"), is_data("Thumbs.db"), is_data("./0000.png")
    (True, False, False, True)
    """
    parts = (part for part in PurePath(name).parts if part not in ("..", "."))
    return not any(map(_is_dropping, parts))


def _is_dropping(name: str) -> bool:
    hidden = name.startswith(".") and not name.endswith(TEMPORARY_SUFFIX)
    return hidden or name.lower() in _LEFT_BY_DESKTOPS


def walk_files(folder: Path) -> list[Path]:
    """All files in a folder and its folders, sorted by path; none if there is no such folder.

    Links to files and folders are followed, but not those to a folder that contains them, which would go round in
    circles. A link to nothing is listed, since a file is missing there. Raises InputError for a folder that
    cannot be listed.
    """
    return sorted(_walk(folder, (Path(os.path.realpath(folder)),)))


def matching(folder: Path, patterns: Iterable[str] | str) -> list[Path]:
    """The data that `Path.glob` finds in a folder by one pattern or several, sorted within each."""
    several = (patterns,) if isinstance(patterns, str) else patterns
    return [
        path
        for pattern in several
        for path in sorted(folder.glob(pattern))
        if is_data(path.relative_to(folder))
    ]


def _walk(folder: Path, chain: tuple[Path, ...]) -> Iterator[Path]:
    """`chain` has the places on disk of the folders on the way, that of `folder` last."""
    try:
        entries = list(os.scandir(folder))
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise InputError(f"{folder}: cannot be listed: {error.strerror}") from error
    for entry in entries:
        if not is_data(entry.name):
            continue
        path = folder / entry.name
        if not entry.is_dir():
            yield path
            continue
        place = Path(os.path.realpath(path)) if entry.is_symlink() else chain[-1] / entry.name
        if not any(passed.is_relative_to(place) for passed in chain):
            yield from _walk(path, (*chain, place))

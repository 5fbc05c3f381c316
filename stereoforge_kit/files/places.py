"""Where a folder or URL really is, whatever it is called: links, `..` and a file:// in front do not count."""

from __future__ import annotations

import posixpath
from pathlib import Path


def is_within(inner: Path | str, outer: Path | str) -> bool:
    """Whether a file or folder is another one, or lies somewhere in it; either may be a URL and need not exist."""
    one, other = _resolved(inner), _resolved(outer)
    return one == other or one.startswith(f"{other.rstrip('/')}/")


def _resolved(place: Path | str) -> str:
    text = str(place)
    scheme, separator, rest = text.partition("://")
    if separator and scheme == "file":
        text, separator = rest, ""
    if not separator:
        return str(Path(text).resolve())
    return f"{scheme}://{posixpath.normpath(rest)}"

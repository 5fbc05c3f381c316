"""Commands must not write into what they read: the check of every pair of flags that name folders."""

from __future__ import annotations

import re
from pathlib import Path

from stereoforge.errors import UsageError
from stereoforge_kit.files import is_within
from stereoforge_kit.messages import shortened

_PREFIX = re.compile(r"\w+:(?!//)")
_PART = re.compile(r"#\d+-\d+\Z")
_LONGEST = 60


def keep_apart(flag: str, written: Path | str, source_flag: str, source: Path | str | None) -> None:
    """Raise UsageError if what a command writes is, or lies in, what it reads, under whichever names.

    Args:
        flag: The flag that says where to write.
        written: Its value, a file, folder or URL.
        source_flag: The flag that says what to read.
        source: Its value: a file, a folder, or a data set as `datagen.sources.registry` takes it; None for none.
    """
    if source is None:
        return
    text = str(source)
    if any(is_within(written, place) for place in {text, _location(text)}):
        raise UsageError(
            f"{flag} {shortened(str(written), _LONGEST)} is, or lies in, {source_flag} {shortened(text, _LONGEST)}, "
            "which is only read: write to another place"
        )


def _location(source: str) -> str:
    """The folder or URL of `[FORMAT:]LOCATION[#FIRST-LAST]`."""
    return _PREFIX.sub("", _PART.sub("", source), count=1)

"""Where commands write: not into what they read, and only where they can."""

from __future__ import annotations

import re
import tempfile
from contextlib import suppress
from pathlib import Path

from stereoforge.errors import UsageError
from stereoforge_kit.files import is_within
from stereoforge_kit.messages import shortened

_PREFIX = re.compile(r"\w+:(?!//)")
_PART = re.compile(r"#\d+-\d+\Z")
_OPTIONS = re.compile(r"(,[a-z]+=[^,]+)+\Z")
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


def check_writable(flag: str, folder: Path) -> None:
    """Raise UsageError unless files can be written into a folder, which need not be there yet.

    To be asked before hours of work whose results go there. Nothing is left behind.
    """
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (FileExistsError, NotADirectoryError) as error:
        raise UsageError(
            f"{flag} {shortened(str(folder), _LONGEST)}: is a file, not a folder, or lies in one"
        ) from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise UsageError(f"{flag} {shortened(str(folder), _LONGEST)}: cannot be written: {reason}") from error
    finally:
        for place in made:
            with suppress(OSError):
                place.rmdir()


def _location(source: str) -> str:
    """The folder or URL of `[FORMAT:]LOCATION[,OPTION=VALUE][#FIRST-LAST]`."""
    return _PREFIX.sub("", _OPTIONS.sub("", _PART.sub("", source)), count=1)

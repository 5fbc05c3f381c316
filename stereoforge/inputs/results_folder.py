"""A folder that collects results: those of one command with one set of options."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stereoforge.errors import CommandError
from stereoforge_kit.files import write_text
from stereoforge_kit.messages import listed

SETTINGS = "settings.json"
"""Name of the file with all that decides the results."""


def claim_results(folder: Path, settings: Mapping[str, Any], flag: str) -> None:
    """Note what decides the results in their folder, or check that what is there was made so.

    Args:
        folder: Of the results.
        settings: JSON values.
        flag: That names the folder.

    Raises:
        CommandError: the folder holds results of other settings, or something else.
    """
    noted = folder / SETTINGS
    if not noted.is_file():
        if folder.is_dir() and any(folder.iterdir()):
            raise CommandError(f"{flag} {folder}: holds something else already; choose another folder")
        write_text(noted, json.dumps(settings, indent=2) + "\n")
        return
    try:
        before = json.loads(noted.read_text(encoding="utf-8"))
        different = [name for name in {**settings, **before} if settings.get(name) != before.get(name)]
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise CommandError(f"{noted}: cannot be read, so nothing can be continued there ({error})") from error
    if different:
        raise CommandError(
            f"{flag} {folder}: holds results of other settings ({listed(different)}); choose another folder"
        )

"""Which version of the code trained a network."""

from __future__ import annotations

import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGE = "stereoforge"
"""The distribution whose version counts."""


def code_revision() -> str:
    """The release and, where the code is a git checkout, its revision (`-dirty` if files changed since)."""
    try:
        release = version(PACKAGE)
    except PackageNotFoundError:
        release = "unknown"
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        )
    except (OSError, subprocess.SubprocessError):
        return release
    return f"{release} ({done.stdout.strip()})"

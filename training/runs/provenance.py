"""Where a network comes from: which data, which version of the code."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import fsspec

from datagen.sources.stereo_frame import StereoFrame

PACKAGE = "stereoforge"


def data_fingerprint(location: str, frames: Sequence[StereoFrame]) -> str:
    """What identifies the frames: the digest of the set's recipe, or of the frames' names where it has none."""
    try:
        with fsspec.open(f"{location.rstrip('/')}/recipe.yaml", "rb") as file:
            digest, what = hashlib.sha256(file.read()), "recipe"
    except (OSError, ValueError, ImportError):
        digest, what = hashlib.sha256("\n".join(frame.name for frame in frames).encode()), "frame names"
    return f"{len(frames)} frames, {what} {digest.hexdigest()}"


def code_revision() -> str:
    """The version, and the git revision where the code is a checkout (`-dirty`: with changes since)."""
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

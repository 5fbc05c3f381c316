"""What identifies the frames of a data set, wherever it lies."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import fsspec

from datagen.sources.stereo_frame import StereoFrame


def data_fingerprint(location: str, frames: Sequence[StereoFrame], scale: str | None = None) -> str:
    """Describe frames by their number and a SHA-256 digest: of the set's recipe, or of the frames' names without one.

    Args:
        location: Folder or URL of the data set.
        frames: The frames that are trained on.
        scale: What the user says that a pixel of disparity is stored as.

    Returns:
        For example `"200 frames, recipe 3f5a..."`.
    """
    try:
        with fsspec.open(f"{location.rstrip('/')}/recipe.yaml", "rb") as file:
            digest, what = hashlib.sha256(file.read()), "recipe"
    except (OSError, ValueError, ImportError):
        digest, what = hashlib.sha256("\n".join(frame.name for frame in frames).encode()), "frame names"
    return f"{len(frames)} frames, {what} {digest.hexdigest()}{f', scale {scale}' if scale else ''}"

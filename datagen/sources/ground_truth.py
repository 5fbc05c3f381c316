"""What a set's ground truth is good for: whether there is any, and how much of it cannot be."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from datagen.errors import DatasetError
from datagen.formats.impossible_disparity import ImpossibleShare
from datagen.sources.stereo_frame import FileFrame, StereoFrame
from stereoforge_kit.messages import shortened

_NAMED = 3
"""Files that a message names."""
_LONGEST_NAME = 80
MOSTLY = 0.5
"""From this share of negative disparities on, the sign is probably meant the other way round."""


def require_ground_truth(location: str, frames: Sequence[StereoFrame]) -> None:
    """Read frames until one has a pixel with ground truth; single frames without any are fine.

    A damaged or missing file is left to whoever needs the frame.

    Raises DatasetError, naming the first files, if no frame has such a pixel.
    """
    shares = []
    for frame in frames:
        try:
            if np.isfinite(frame.disparity_left).any():
                return
        except DatasetError:
            return
        shares.append(frame.impossible_left)
    if not shares:
        return
    files = ", ".join(_shown(location, frames[i]) for i in range(min(_NAMED, len(frames))))
    impossible = mean_share(shares)
    reason = f"; {impossible}" if impossible else ""
    sign = "; is the sign the other way round?" if impossible.negative > MOSTLY else ""
    raise DatasetError(
        f"{location}: no pixel of its {len(frames)} frames has ground truth ({files}{', ...' * (len(frames) > _NAMED)})"
        f"{reason}{sign}"
    )


def mean_share(shares: Iterable[ImpossibleShare]) -> ImpossibleShare:
    """The mean over frames, nothing for no frame."""
    each = [(share.negative, share.too_large) for share in shares]
    return ImpossibleShare(*map(float, np.mean(each, axis=0))) if each else ImpossibleShare()


def _shown(location: str, frame: StereoFrame) -> str:
    """A frame's file below the set's folder, or the frame's name; the end of what is long."""
    path = frame.disparity_file if isinstance(frame, FileFrame) else None
    if path is None:
        name = frame.name
    else:
        root = Path(location.partition("#")[0])
        name = path.relative_to(root).as_posix() if path.is_relative_to(root) else str(path)
    return shortened(name, _LONGEST_NAME)

"""The pairs of two videos, decoded one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from imageio.v3 import imopen
from numpy.typing import NDArray

from datagen.formats.limits import check_image_size
from stereoforge.errors import CommandError

VIDEOS = (".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v")
"""Endings of the videos that are read."""
USUAL_FPS = 25.0
"""Frames a second of a video that does not say."""


@dataclass(frozen=True)
class VideoPair:
    """One frame of both videos."""

    name: str
    """The folder of its results: frame_000000 for the first."""
    left: NDArray[np.uint8]
    """(H, W, 3) RGB."""
    right: NDArray[np.uint8]
    """(H, W, 3) RGB."""

    def read(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8], list[str]]:
        """Both views, and no remarks."""
        return self.left, self.right, []


class VideoPairs:
    """Two videos, frame by frame. Iterating decodes them; only one pair is in memory at a time."""

    note = None

    def __init__(self, left: Path, right: Path) -> None:
        """Look at both videos.

        Raises:
            CommandError: one is missing, damaged or no video, or they differ in size.
        """
        self.left, self.right = left, right
        self._left, self._right = _Video(left), _Video(right)
        if self._left.size != self._right.size:
            sizes = ["x".join(map(str, video.size)) for video in (self._left, self._right)]
            raise CommandError(f"the videos differ in size: {left} is {sizes[0]}, {right} is {sizes[1]}")

    def __len__(self) -> int:
        """Pairs that the videos have by their own account, which may be wrong."""
        return min(self._left.frames, self._right.frames)

    @property
    def frames_per_second(self) -> float:
        """Of the left video."""
        return self._left.frames_per_second

    def __iter__(self) -> Iterator[VideoPair]:
        """Decode the pairs.

        Raises:
            CommandError: one video is damaged, or ends before the other; the pairs before that have been given.
        """
        views = zip_longest(self._left.decoded(), self._right.decoded())
        for number, (left, right) in enumerate(views):
            if left is None or right is None:
                short, other = (self.left, self.right) if left is None else (self.right, self.left)
                raise CommandError(f"{short}: ends after {number} frames, and {other} goes on")
            yield VideoPair(f"frame_{number:06d}", left, right)


class _Video:
    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise CommandError(f"{path}: there is no such file")
        self.path = path
        with self._open() as video:
            try:
                found: dict[str, Any] = video.metadata()
                properties = video.properties()
            except Exception as error:  # PyAV has an exception for every code of FFmpeg
                raise self._damaged(error) from error
        self.frames_per_second = float(found.get("fps") or USUAL_FPS)
        self.size = int(properties.shape[2]), int(properties.shape[1])
        check_image_size(path, *self.size, 3)
        self.frames = properties.n_images or round(float(found.get("duration") or 0) * self.frames_per_second)

    def decoded(self) -> Iterator[NDArray[np.uint8]]:
        with self._open() as video:
            try:
                for frame in video.iter(format="rgb24"):
                    yield np.ascontiguousarray(frame)
            except Exception as error:
                raise self._damaged(error) from error

    def _open(self) -> Any:
        try:
            return imopen(self.path, "r", plugin="pyav")
        except ImportError:
            raise
        except Exception as error:
            raise self._damaged(error) from error

    def _damaged(self, error: Exception) -> CommandError:
        return CommandError(f"{self.path}: cannot be read as a video ({error})")

"""What the user names to be matched: two pictures, two folders of them, two videos, or a list."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from stereoforge.errors import UsageError
from stereoforge.inputs.picture_pairs import find_pairs, listed_pairs
from stereoforge.inputs.videos import VIDEOS, VideoPairs

LISTS = (".txt", ".csv", ".tsv", ".lst")
"""Endings of lists."""


class StereoPair(Protocol):
    """Two views."""

    @property
    def name(self) -> str:
        """The folder of its results; empty for the only pair, whose results lie in the folder of all."""

    def read(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8], list[str]]:
        """Both views (H, W, 3), and remarks about them."""


class StereoPairs(Protocol):
    """Pairs that are read one after the other."""

    @property
    def note(self) -> str | None:
        """What the user should know of how views were matched to one another."""

    def __len__(self) -> int:
        """How many there are; of videos, by their own account."""

    def __iter__(self) -> Iterator[StereoPair]:
        """Give them one after the other."""


def open_pairs(left: Path, right: Path | None) -> StereoPairs:
    """The pairs of two pictures, two folders of pictures or two videos, or, with one path alone, those of a list.

    Raises:
        UsageError: things of two kinds, a folder without pictures or without partners, or one path that is no list.
        DatasetError: a list that cannot be understood.
        CommandError: videos that cannot be read.
    """
    if right is None:
        if left.suffix.lower() not in LISTS or not left.is_file():
            raise UsageError(f"{left}: is no list of pairs ({', '.join(LISTS)}), and no RIGHT goes with it")
        return listed_pairs(left)
    videos = [path for path in (left, right) if path.suffix.lower() in VIDEOS and not path.is_dir()]
    if len(videos) == 1:
        other = right if videos[0] == left else left
        raise UsageError(f"{videos[0]} is a video and {other} is not; give two videos")
    return VideoPairs(left, right) if videos else find_pairs(left, right)

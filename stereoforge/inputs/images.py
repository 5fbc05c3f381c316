"""Read the pair of pictures that the user names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.picture import read_pair
from stereoforge.errors import CommandError

BLACK = 3
"""A picture without a brighter value, of 255, is black."""


def read_color_images(left: Path, right: Path) -> tuple[NDArray[np.uint8], NDArray[np.uint8], list[str]]:
    """Both views as `datagen.formats.picture` reads them, (H, W, 3) uint8, and remarks about them.

    Raises CommandError for a missing file, one that is no picture, a damaged one, or one that is too large.
    """
    for path in (left, right):
        if not path.is_file():
            raise CommandError(
                f"{path}: is a folder, not a picture" if path.is_dir() else f"{path}: there is no such file"
            )
    try:
        return read_pair(left, right)
    except FormatError as error:
        hint = "; a disparity is given with --disparity" if "map of numbers" in str(error) else ""
        raise CommandError(f"{error}{hint}") from error


def pair_doubts(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> list[str]:
    """A sentence for each thing that is wrong with a pair as a whole: black or plain pictures, or twice the same."""
    doubts = []
    for name, view in (("left", left), ("right", right)):
        if view.max() <= BLACK:
            doubts.append(f"the {name} picture is black")
        elif (view == view[0, 0]).all():
            doubts.append(f"the {name} picture has one colour only")
    if not doubts and left.shape == right.shape and np.array_equal(left, right):
        doubts.append("both pictures are the same: is the right view another file?")
    return doubts

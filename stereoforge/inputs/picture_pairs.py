"""Find the pairs of pictures that the user names: two files, or two folders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.sources.own_data.listing import VIEWS, read_list
from stereoforge.errors import UsageError
from stereoforge.inputs.images import read_color_images

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".ppm", ".pgm")
"""Endings of the pictures in a folder."""


@dataclass(frozen=True)
class PicturePair:
    """Two files."""

    name: str
    """The folder of its results in --out; empty for the only pair, whose results lie in --out itself."""
    left: Path
    right: Path

    def read(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8], list[str]]:
        """Both views as `read_color_images` gives them, and remarks about them."""
        return read_color_images(self.left, self.right)


@dataclass(frozen=True)
class PicturePairs:
    """All pairs, and how they were found."""

    pairs: tuple[PicturePair, ...]
    note: str | None = None
    """What the user should know of how pictures were matched to one another."""

    def __len__(self) -> int:
        """How many there are."""
        return len(self.pairs)

    def __iter__(self) -> Iterator[PicturePair]:
        """One after the other."""
        return iter(self.pairs)


def find_pairs(left: Path, right: Path) -> PicturePairs:
    """The pairs of two pictures, or of two folders of pictures.

    Pictures of two folders are paired by their names. Where the names differ, as in left_01.png and right_01.png, they
    are paired in the order of their names.

    Raises:
        UsageError: a folder beside a picture, a folder without pictures, or folders with different numbers of them.
    """
    if not left.is_dir() and not right.is_dir():
        return PicturePairs((PicturePair("", left, right),))
    for folder, other in ((left, right), (right, left)):
        if not folder.is_dir():
            raise UsageError(f"{folder}: is no folder, and {other} is one; give two pictures or two folders")
    views = _pictures(left), _pictures(right)
    if len(views[0]) != len(views[1]):
        raise UsageError(
            f"{len(views[0])} left and {len(views[1])} right pictures{_without_partner(*views)}; each needs its partner"
        )
    pairs = tuple(PicturePair(one.stem, one, other) for one, other in zip(*views, strict=True))
    names = [pair.name for pair in pairs]
    if len(set(names)) != len(names):
        raise UsageError(f"{left}: two pictures have the same name but for their endings")
    if names == [pair.right.stem for pair in pairs]:
        return PicturePairs(pairs)
    first = pairs[0]
    return PicturePairs(
        pairs, f"paired in the order of their names, such as {first.left.name} and {first.right.name}"
    )


def listed_pairs(file: Path) -> PicturePairs:
    """The pairs that a list names, one a line, with paths relative to its folder; further columns are left out.

    Raises:
        DatasetError: a list without pairs, or a line that is none, with its number.
        UsageError: two lines with the same left picture, or a picture that is not there.
    """
    pairs: dict[str, PicturePair] = {}
    for line in read_list(file, VIEWS).lines:
        left, right = (file.parent / line.files[view].replace("\\", "/") for view in VIEWS)
        for path in (left, right):
            if not path.is_file():
                raise UsageError(f"{file}: line {line.number}: there is no file {path}")
        inside = left.is_relative_to(file.parent) and ".." not in left.parts
        name = "_".join(left.relative_to(file.parent).with_suffix("").parts) if inside else left.stem
        if name in pairs:
            raise UsageError(
                f"{file}: line {line.number}: its results would be called {name}, as those of another line are"
            )
        pairs[name] = PicturePair(name, left, right)
    return PicturePairs(tuple(pairs.values()))


def _pictures(folder: Path) -> list[Path]:
    """The pictures of a folder by their names, without hidden files."""
    found = sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in PICTURES and not path.name.startswith(".") and path.is_file()
    )
    if not found:
        raise UsageError(f"{folder}: holds no pictures ({', '.join(PICTURES)})")
    return found


def _without_partner(left: list[Path], right: list[Path]) -> str:
    """The first picture whose name the other folder does not have, where most have one."""
    names = {path.stem for path in left}, {path.stem for path in right}
    if 2 * len(names[0] & names[1]) < len(names[0]):
        return ""
    for paths, others in ((left, names[1]), (right, names[0])):
        for path in paths:
            if path.stem not in others:
                return f" ({path} has none)"
    return ""

"""One way to open every data set that can be trained or evaluated on.

A source is written `[FORMAT:]LOCATION[#FIRST-LAST]`, for example `data`, `kitti2015:/sets/kitti`, `sintel:sets/sintel`,
`webdataset:s3://bucket/set` or `kitti2015:/sets/kitti#0-99` (its first hundred frames). Without a format the folder's
structure decides. A new format is one module in `datagen.sources` with a tuple `FORMATS`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from datagen.errors import DatasetError
from datagen.sources.stereo_frame import StereoFrame

_SELECTION = re.compile(r"(.+)#(\d{1,9})-(\d{1,9})")
_FORMAT_NAME = re.compile(r"[A-Za-z][\w-]+")
"""Of two letters and more: one alone is a drive."""
_PATTERN = re.compile(r"[*?\[{]")


@dataclass(frozen=True)
class SourceFormat:
    """How one kind of data set is recognised and listed."""

    name: str
    """What the user writes in front of the location."""
    title: str
    """The data set's name in messages and documentation."""
    recognises: Callable[[Path], bool]
    """Whether a folder has this format. Never True for a folder of another format."""
    find_frames: Callable[[str, str], Sequence[StereoFrame]]
    """From (location, split) to the frames with ground truth, in order. A format without splits ignores the split."""
    splits: tuple[str, ...] = ()
    """The splits that the format has; empty if all its frames belong to every split."""
    takes_patterns: bool = False
    """Whether a location may be a pattern of files' names, which need not exist as it is written."""


@dataclass(frozen=True)
class DataSource:
    """An opened data set."""

    format: SourceFormat
    location: str
    """Folder, file or URL."""
    selection: tuple[int, int] | None = None
    """Numbers of the first and the last frame to take, from 0; None for all frames."""

    def frames(self, split: str) -> Sequence[StereoFrame]:
        """The frames of a split: "train", "val" or "test".

        A set without splits has all its frames in each of them. Raises DatasetError if the set has no such split, no
        frame in it, or fewer frames than the selection asks for.
        """
        if self.format.splits and split not in self.format.splits:
            raise DatasetError(f"{self.location}: {self.format.title} has no split {split!r}")
        frames = self.format.find_frames(self.location, split)
        if not len(frames):
            raise DatasetError(f"{self.location}: {self._nothing(split)}")
        if self.selection is None:
            return frames
        first, last = self.selection
        if not first <= last < len(frames):
            raise DatasetError(
                f"{self.location}: frames {first} to {last} were asked for, it has {len(frames)} (from 0)"
            )
        return frames[first : last + 1]

    def _nothing(self, split: str) -> str:
        """What to say of a set without a frame in a split: that others have some, or that none has."""
        others = (each for each in self.format.splits if each != split)
        counts = {each: len(self.format.find_frames(self.location, each)) for each in others}
        present = " and ".join(f"{count} {each}" for each, count in counts.items() if count)
        if present:
            return f"has no {split} frames; there are {present}"
        return f"has no frame with ground truth in the layout of {self.format.title}"

    def validation_frames(self) -> Sequence[StereoFrame]:
        """The frames of the set's own validation split, empty if it has none."""
        return self.format.find_frames(self.location, "val") if "val" in self.format.splits else []

    def held_out_frames(self) -> Sequence[StereoFrame]:
        """The frames to validate on if the whole source is meant for it: the val split, else the test split, else all.

        Raises DatasetError as `frames` does.
        """
        splits = self.format.splits
        return self.frames("test" if "val" not in splits else "val")


def open_source(text: str | Path) -> DataSource:
    """Open a data set written as `[FORMAT:]LOCATION[#FIRST-LAST]`.

    Raises DatasetError for a folder that is missing, or whose format is unknown or ambiguous.
    """
    location, selection = str(text), None
    if not Path(location).exists() and (match := _SELECTION.fullmatch(location)):
        location, selection = match[1], (int(match[2]), int(match[3]))
    prefix, colon, rest = location.partition(":")
    formats = source_formats()
    if colon and not Path(location).exists():
        if prefix in formats:
            return DataSource(formats[prefix], _existing(rest, formats[prefix].takes_patterns), selection)
        if _FORMAT_NAME.fullmatch(prefix) and not rest.startswith("//"):
            raise DatasetError(f"{location}: there is no format {prefix}; there are {_listed(formats)}")
    if "://" in location:
        raise DatasetError(f"{location}: say what is there, for example webdataset:{location}")
    location = _existing(location)
    folder = Path(location)
    found = [kind for kind in formats.values() if kind.recognises(folder)]
    if len(found) != 1:
        what = " and ".join(kind.title for kind in found) or "no data set of a known layout"
        raise DatasetError(
            f"{folder}: looks like {what}; name the format in front, such as {next(iter(formats))}:{folder} "
            f"(there are {_listed(formats)})"
        )
    return DataSource(found[0], location, selection)


def _existing(location: str, pattern_allowed: bool = False) -> str:
    """A folder, file or URL with `~` replaced by the home folder, which a shell does not do after a prefix.

    Raises DatasetError for one on this machine that is missing.
    """
    if "://" in location:
        return location
    found = location if Path(location).exists() else with_home(location)
    if not Path(found).exists() and not (pattern_allowed and _PATTERN.search(location)):
        what = "file" if found.endswith(".tar") else "folder"
        hint = (
            f"; of shards write webdataset:{location}" if what == "file" and _PATTERN.search(location) else ""
        )
        raise DatasetError(f"{found}: there is no such {what}{hint}")
    return found


def with_home(location: str) -> str:
    """A location with `~` replaced by the home folder; that of a user who is not there stays as it is."""
    return os.path.expanduser(location)  # noqa: PTH111 (Path.expanduser raises for such a user.)


def _listed(formats: Iterable[str]) -> str:
    """The names of formats in a sentence, without those of final passes."""
    return ", ".join(name for name in formats if not name.endswith("-final"))


def source_formats() -> dict[str, SourceFormat]:
    """All formats by their names."""
    import datagen.sources
    from stereoforge_kit.discovery import modules_in

    return {
        kind.name: kind for module in modules_in(datagen.sources) for kind in getattr(module, "FORMATS", ())
    }

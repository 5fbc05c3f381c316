"""One way to open every data set that can be trained or evaluated on.

A source is written `[FORMAT:]LOCATION[,OPTION=VALUE][#FIRST-LAST]`, for example `data`, `kitti2015:/sets/kitti`,
`webdataset:s3://bucket/set`, `list:pairs.csv,root=/sets` or `kitti2015:/sets/kitti#0-99` (its first hundred frames).
Without a format the folder's structure decides. A new format is one module in `datagen.sources` with a tuple `FORMATS`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from datagen.errors import DatasetError
from datagen.sources.stereo_frame import StereoFrame
from stereoforge_kit.messages import shortened

_SELECTION = re.compile(r"(.+)#(\d{1,9})-(\d{1,9})")
_FORMAT_NAME = re.compile(r"[A-Za-z][\w-]+")
"""Of two letters and more: one alone is a drive."""
_OPTIONS = re.compile(r"(,[a-z]+=[^,]+)+\Z")
SET_ASIDE = 0.1
"""Share of the frames that is kept for validation where a set has no validation split of its own."""
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
    find_frames: Callable[..., Sequence[StereoFrame]]
    """From (location, split) and the options by their names to the frames with ground truth, in order. A format without
    splits ignores the split."""
    splits: tuple[str, ...] = ()
    """The splits that the format has; empty if all its frames belong to every split."""
    takes_patterns: bool = False
    """Whether a location may be a pattern of files' names, which need not exist as it is written."""
    options: tuple[str, ...] = ()
    """What may stand behind a location as `,NAME=VALUE`."""
    find_splits: Callable[[str], tuple[str, ...]] | None = None
    """The splits that a location has, for a format whose sets differ in that."""
    sets_aside: bool = False
    """Whether a part of what is trained on is kept for validation where a set has no val split."""
    describe: Callable[..., str] | None = None
    """From a location and the options to a sentence on what was taken for what, for a format that has to guess."""


@dataclass(frozen=True)
class DataSource:
    """An opened data set."""

    format: SourceFormat
    location: str
    """Folder, file or URL."""
    selection: tuple[int, int] | None = None
    """Numbers of the first and the last frame to take, from 0; None for all frames."""
    options: Mapping[str, str] = field(default_factory=dict)
    """Values of the format's options."""

    @cached_property
    def splits(self) -> tuple[str, ...]:
        """The splits that the set has; empty if all its frames belong to every split."""
        return (
            self.format.splits if self.format.find_splits is None else self.format.find_splits(self.location)
        )

    @property
    def sets_aside(self) -> bool:
        """Whether the last tenth of the frames to train on is for validation."""
        return self.format.sets_aside and self.selection is None and "val" not in self.splits

    @property
    def note(self) -> str | None:
        """A sentence on what was taken for what, where that was guessed. Raises DatasetError as `frames` does."""
        return None if self.format.describe is None else self.format.describe(self.location, **self.options)

    def frames(self, split: str) -> Sequence[StereoFrame]:
        """The frames of a split: "train", "val" or "test".

        A set without splits has all its frames in each of them, but for what `sets_aside` keeps for validation. Raises
        DatasetError if the set has no such split, no frame in it, or fewer frames than the selection asks for.
        """
        if self.sets_aside and split in ("train", "val"):
            frames = self._whole("train")
            first = _first_set_aside(frames)
            return frames[:first] if split == "train" else frames[first:]
        frames = self._whole(split)
        if self.selection is None:
            return frames
        first, last = self.selection
        if not first <= last < len(frames):
            raise DatasetError(
                f"{self.location}: frames {first} to {last} were asked for, it has {len(frames)} (from 0)"
            )
        return frames[first : last + 1]

    def _whole(self, split: str) -> Sequence[StereoFrame]:
        """All frames of a split, with those that are set aside."""
        if self.splits and split not in self.splits:
            there = f"; there is {' and '.join(self.splits)}" if self.format.find_splits else ""
            raise DatasetError(f"{self.location}: {self.format.title} has no split {split!r}{there}")
        frames = self._find(split)
        if not len(frames):
            raise DatasetError(f"{self.location}: {self._nothing(split)}")
        return frames

    def _find(self, split: str) -> Sequence[StereoFrame]:
        return self.format.find_frames(self.location, split, **self.options)

    def _nothing(self, split: str) -> str:
        """What to say of a set without a frame in a split: that others have some, or that none has."""
        others = (each for each in self.splits if each != split)
        counts = {each: len(self._find(each)) for each in others}
        present = " and ".join(f"{count} {each}" for each, count in counts.items() if count)
        if present:
            return f"has no {split} frames; there are {present}"
        return f"has no frame with ground truth in the layout of {self.format.title}"

    def validation_frames(self) -> Sequence[StereoFrame]:
        """The frames of the set's own validation split, or those that are set aside; empty if it has neither."""
        if self.sets_aside:
            return self.frames("val")
        return self._find("val") if "val" in self.splits else []

    def held_out_frames(self) -> Sequence[StereoFrame]:
        """The frames to validate on if the whole source is meant for it: the val split, else the test split, else all.

        Raises DatasetError as `frames` does.
        """
        has_test = not self.splits or "test" in self.splits
        return self.frames("test" if has_test and "val" not in self.splits else "val")


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
            found, options = _split_options(rest, formats[prefix])
            return DataSource(
                formats[prefix], _existing(found, formats[prefix].takes_patterns), selection, options
            )
        if _FORMAT_NAME.fullmatch(prefix) and not rest.startswith("//"):
            raise DatasetError(
                f"{shortened(location, 60)}: there is no format {prefix}; there are {_listed(formats)}"
            )
    if "://" in location:
        where = shortened(location, 100)
        raise DatasetError(f"{where}: say what is there, for example webdataset:{where}")
    location = _existing(location)
    folder = Path(location)
    fitting = [kind for kind in formats.values() if kind.recognises(folder)]
    if len(fitting) != 1:
        what = " and ".join(kind.title for kind in fitting) or "no data set of a known layout"
        such_as = fitting[0].name if fitting else "folder" if folder.is_dir() else "list"
        raise DatasetError(
            f"{shortened(location, 120)}: looks like {what}; name the format in front, such as {such_as}:PATH"
        )
    return DataSource(fitting[0], location, selection)


def _split_options(text: str, kind: SourceFormat) -> tuple[str, dict[str, str]]:
    """A location and the options behind it. Raises DatasetError for options that the format does not have."""
    match = None if Path(text).exists() else _OPTIONS.search(text)
    location, written = (text, "") if match is None else (text[: match.start()], match[0])
    options = dict(part.split("=", 1) for part in written.split(",")[1:])
    if unknown := next((name for name in options if name not in kind.options), None):
        has = (
            f"there is {' and '.join(f'{name}=' for name in kind.options)}" if kind.options else "it has none"
        )
        raise DatasetError(f"{text}: {kind.title} has no option {unknown}=; {has}")
    return location, options


def _first_set_aside(frames: Sequence[StereoFrame]) -> int:
    """The number of the first of the last tenth of the frames, from where on they are kept for validation.

    Whole scenes are kept, unless that would be more than half of the frames. One frame alone is trained on.
    """
    first = len(frames) - max(round(SET_ASIDE * len(frames)), min(1, len(frames) - 1))
    if first == len(frames):
        return first
    scene, begin = frames[first].scene_name, first
    while begin and frames[begin - 1].scene_name == scene:
        begin -= 1
    return begin if 2 * begin >= len(frames) else first


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

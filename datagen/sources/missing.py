"""Which files of a set's frames are missing, before anything is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload

from datagen.dataset.remote_cache import RemoteLayout
from datagen.dataset.samples import StereoSample
from datagen.sources.stereo_frame import FileFrame, StereoFrame
from stereoforge_kit.messages import shortened

_NAMED = 3
"""Files that a message names."""
_LONGEST_NAME = 60


def missing_files(frames: Sequence[StereoFrame]) -> dict[int, list[Path]]:
    """The files that are not there, by the number of the frame; frames that lack none are left out.

    Samples in shards and frames behind a URL have no files of their own on this machine and are taken to be whole.
    """
    lacking = {number: [p for p in _files(frame) if not p.is_file()] for number, frame in enumerate(frames)}
    return {number: paths for number, paths in lacking.items() if paths}


def describe_missing(location: str, missing: Mapping[int, Sequence[Path]], frames: int) -> str:
    """One sentence: how many files of a set with so many frames are missing, and the first of them."""
    paths = [path for several in missing.values() for path in several]
    root = Path(location.partition("#")[0].rpartition(":")[2])
    names = ", ".join(_shown(path, root) for path in paths[:_NAMED])
    more = ", ..." if len(paths) > _NAMED else ""
    files = "1 file" if len(paths) == 1 else f"{len(paths)} files"
    return f"missing: {files} of {len(missing)} of its {frames} frames ({names}{more})"


@dataclass(frozen=True)
class ChosenFrames(Sequence[StereoFrame]):
    """Some frames of a set, in order."""

    frames: Sequence[StereoFrame]
    numbers: Sequence[int]
    """Of the frames that are taken."""

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, index: int) -> StereoFrame: ...

    @overload
    def __getitem__(self, index: slice) -> ChosenFrames: ...

    def __getitem__(self, index: int | slice) -> StereoFrame | ChosenFrames:
        if isinstance(index, slice):
            return ChosenFrames(self.frames, self.numbers[index])
        return self.frames[self.numbers[index]]


def _files(frame: StereoFrame) -> tuple[Path, ...]:
    if isinstance(frame, FileFrame):
        return frame.files
    if isinstance(frame, StereoSample) and not isinstance(frame.layout, RemoteLayout):
        return frame.evaluated_files
    return ()


def _shown(path: Path, root: Path) -> str:
    name = path.relative_to(root).as_posix() if path.is_relative_to(root) else str(path)
    return shortened(name, _LONGEST_NAME)

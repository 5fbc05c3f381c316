"""A rectified stereo pair with ground truth, from any data set."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from datagen.errors import DatasetError
from datagen.formats.impossible_disparity import GROUND_TRUTH_NOISE_PX, ImpossibleShare, drop_impossible
from datagen.ground_truth.from_disparity import derive_gradient, derive_occlusion

Picture = NDArray[np.uint8]
DisparityMap = NDArray[np.float32]


class StereoFrame(Protocol):
    """What the frames of every source have. A `StereoSample` of StereoForge's own sets is one and has more.

    Arrays are read at first use. Reading raises DatasetError, naming the file.
    """

    @property
    def name(self) -> str:
        """A name that is unique within the source."""

    @property
    def scene_name(self) -> str:
        """The scene of the source that the frame belongs to.

        Frames of one scene show the same things at other moments, from other places or in other light. So they are not
        independent samples.
        """

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) in pixels."""

    @property
    def left(self) -> Picture:
        """(H, W, 3) sRGB."""

    @property
    def right(self) -> Picture:
        """(H, W, 3) sRGB."""

    @property
    def disparity_left(self) -> DisparityMap:
        """(H, W) pixels, x_right = x_left - d; NaN invalid, 0 infinitely far unless the principal points differ."""

    @property
    def disparity_right(self) -> DisparityMap | None:
        """(H, W) pixels, x_left = x_right + d; None if the set has none."""

    @property
    def impossible_left(self) -> ImpossibleShare:
        """How many of the left view's disparities cannot be; they are NaN in `disparity_left`."""

    @property
    def gradient_left(self) -> NDArray[np.float32]:
        """(H, W, 2) forward differences [dx, dy], 0 where there is none."""

    @property
    def gradient_valid_left(self) -> NDArray[np.bool_]:
        """(H, W) True where the gradient exists and is no discontinuity."""

    @property
    def occlusion_left(self) -> NDArray[np.uint8] | None:
        """(H, W) 0 visible in the right view, 1 occluded there, 2 out of its frame; None if it is not known."""

    @property
    def object_index_left(self) -> NDArray[np.uint16] | None:
        """(H, W) 0 where nothing is hit (sky), else the number of an object; None if the set has none."""

    @property
    def foreground_left(self) -> NDArray[np.uint16] | None:
        """(H, W) 0 background, else the number of a foreground object, as in KITTI's object map, where those are cars.

        None if the set does not tell foreground from background.
        """


@dataclass(frozen=True)
class FileFrame:
    """A `StereoFrame` of somebody else's data set: how each of its arrays is read, None for what the set lacks.

    Gradients are derived from the disparity. Occlusion is the set's own if `read_occlusion_left` is given, derived
    from both disparities if the set has both, and otherwise unknown. Disparities that cannot be become NaN, by the rule
    of `datagen.formats.impossible_disparity`. An array is read once and kept; DatasetError is raised for one that does
    not have the size of the left image.
    """

    name: str
    scene_name: str
    read_left: Callable[[], Picture]
    read_right: Callable[[], Picture]
    read_disparity_left: Callable[[], DisparityMap]
    read_disparity_right: Callable[[], DisparityMap] | None = None
    read_occlusion_left: Callable[[], NDArray[np.uint8]] | None = None
    read_object_index_left: Callable[[], NDArray[np.uint16]] | None = None
    read_foreground_left: Callable[[], NDArray[np.uint16]] | None = None
    disparity_noise_px: float = GROUND_TRUTH_NOISE_PX
    """Disparities that are less than at infinity by more than this are none."""
    find_disparity_at_infinity: Callable[[], float] = float
    """The disparity of what is infinitely far, 0 unless the views' principal points differ."""
    origin: str = ""
    """Where the frame is named, such as a line of a list; messages say it."""

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) in pixels, from the left image."""
        height, width = self.left.shape[:2]
        return height, width

    @cached_property
    def left(self) -> Picture:
        """(H, W, 3) uint8 sRGB."""
        return self._read(self.read_left)

    @cached_property
    def right(self) -> Picture:
        """(H, W, 3) uint8 sRGB."""
        return self._checked("right image", self.read_right)

    @property
    def disparity_left(self) -> DisparityMap:
        """(H, W) float32 px; NaN invalid, 0 infinitely far."""
        return self._disparity_left[0]

    @property
    def impossible_left(self) -> ImpossibleShare:
        """How many of the left view's disparities cannot be; they are NaN in `disparity_left`."""
        return self._disparity_left[1]

    @cached_property
    def disparity_right(self) -> DisparityMap | None:
        """(H, W) float32 px; None if the set has none."""
        if self.read_disparity_right is None:
            return None
        disparity = self._checked("right disparity", self.read_disparity_right)
        return self._possible(disparity)[0]

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that the frame is read from; none where it is a part of another file."""
        readers = (getattr(self, field.name) for field in fields(self) if field.name.startswith("read_"))
        arguments = (read.args for read in readers if isinstance(read, partial))
        return tuple(dict.fromkeys(value for args in arguments for value in args if isinstance(value, Path)))

    @property
    def disparity_file(self) -> Path | None:
        """The file of the left disparity; None where it is a part of another one."""
        return _first_path(self.read_disparity_left)

    @property
    def gradient_left(self) -> NDArray[np.float32]:
        """(H, W, 2) forward differences [dx, dy], 0 where there is none."""
        return self._gradient_left[0]

    @property
    def gradient_valid_left(self) -> NDArray[np.bool_]:
        """(H, W) True where the gradient exists and is no discontinuity."""
        return self._gradient_left[1]

    @cached_property
    def occlusion_left(self) -> NDArray[np.uint8] | None:
        """(H, W) 0 visible in the right view, 1 occluded there, 2 out of its frame; None if it is not known."""
        if self.read_occlusion_left is not None:
            return self._checked("occlusion", self.read_occlusion_left)
        if self.disparity_right is None:
            return None
        return derive_occlusion("left", self.disparity_left, self.disparity_right)

    @cached_property
    def object_index_left(self) -> NDArray[np.uint16] | None:
        """(H, W) 0 where nothing is hit (sky), else the number of an object; None if the set has none."""
        if self.read_object_index_left is None:
            return None
        return self._checked("object index", self.read_object_index_left)

    @cached_property
    def foreground_left(self) -> NDArray[np.uint16] | None:
        """(H, W) 0 background, else the number of a foreground object; None if the set does not tell."""
        if self.read_foreground_left is None:
            return None
        return self._checked("foreground", self.read_foreground_left)

    @cached_property
    def _disparity_left(self) -> tuple[DisparityMap, ImpossibleShare]:
        disparity = self._checked("left disparity", self.read_disparity_left)
        return self._possible(disparity)

    def _possible(self, disparity: DisparityMap) -> tuple[DisparityMap, ImpossibleShare]:
        return drop_impossible(disparity, self.disparity_noise_px, self.find_disparity_at_infinity())

    @cached_property
    def _gradient_left(self) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        return derive_gradient(self.disparity_left)

    def _read(self, read: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        try:
            return read()
        except DatasetError as error:
            if not self.origin:
                raise
            raise type(error)(f"{error} ({self.origin})") from error

    def _checked(self, what: str, read: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        """What is read, if it has the size of the left image. Raises DatasetError, naming the file."""
        array = self._read(read)
        if array.shape[:2] != self.size:
            path = _first_path(read)
            where = ", ".join(str(place) for place in (path, self.origin) if place)
            raise DatasetError(
                f"{self.name}: its {what} is {array.shape[1]}x{array.shape[0]}, "
                f"its left image {self.size[1]}x{self.size[0]}{where and f' ({where})'}"
            )
        return array


def _first_path(read: Callable[[], Any]) -> Path | None:
    """The file that a reader reads, as far as it says so."""
    paths = [value for value in read.args if isinstance(value, Path)] if isinstance(read, partial) else []
    return paths[0] if paths else None


class FileFrames(Sequence[StereoFrame]):
    """The frames of somebody else's data set.

    A frame keeps what it has read. So each access returns a new frame, and memory does not grow in a run that goes
    through a set many times.
    """

    def __init__(self, frames: Iterable[FileFrame]) -> None:
        self._frames = tuple(frames)

    def __len__(self) -> int:
        return len(self._frames)

    @overload
    def __getitem__(self, index: int) -> StereoFrame: ...

    @overload
    def __getitem__(self, index: slice) -> FileFrames: ...

    def __getitem__(self, index: int | slice) -> StereoFrame | FileFrames:
        if isinstance(index, slice):
            return FileFrames(self._frames[index])
        return replace(self._frames[index])

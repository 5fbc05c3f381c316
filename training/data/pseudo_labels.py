"""Training on disparities that somebody else predicted, in place of a data set's own truth.

The paper's GradNet for KITTI, whose laser truth is too sparse for gradients, learned from the dense disparities of
another stereo method.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from datagen.formats import read_pfm
from datagen.sources.kitti import read_disparity as read_kitti_disparity
from datagen.sources.stereo_frame import FileFrame, StereoFrame
from training.errors import TrainingError

_READERS = {".pfm": read_pfm, ".png": read_kitti_disparity}


class PseudoFrames(Sequence[StereoFrame]):
    """The frames of a data set with the disparities of a folder for their left view's truth.

    A frame `a/b` takes `a/b.pfm` of the folder (pixels; infinity or NaN where there is none) or `a/b.png` (as KITTI's:
    16 bits, over 256, 0 where there is none). The right view has no truth then, and occlusion is unknown.
    """

    def __init__(self, frames: Sequence[StereoFrame], folder: Path) -> None:
        """Raises TrainingError, naming the first frame that the folder has nothing for."""
        self._frames = frames
        self._files = [_file_of(folder, frame.name) for frame in frames]

    def __len__(self) -> int:
        return len(self._frames)

    @overload
    def __getitem__(self, index: int) -> StereoFrame: ...

    @overload
    def __getitem__(self, index: slice) -> list[StereoFrame]: ...

    def __getitem__(self, index: int | slice) -> StereoFrame | list[StereoFrame]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        frame = self._frames[index]
        return FileFrame(
            name=frame.name,
            scene_name=frame.scene_name,
            read_left=partial(getattr, frame, "left"),
            read_right=partial(getattr, frame, "right"),
            read_disparity_left=partial(_read, self._files[index]),
        )


def _file_of(folder: Path, name: str) -> Path:
    for suffix in _READERS:
        path = folder / f"{name}{suffix}"
        if path.is_file():
            return path
    raise TrainingError(
        f"{folder}: has no disparity for the frame {name} (neither {name}.pfm nor {name}.png)"
    )


def _read(path: Path) -> NDArray[np.float32]:
    disparity = _READERS[path.suffix](path)
    disparity[~np.isfinite(disparity)] = np.nan
    return disparity

"""Results in the form the KITTI 2015 server takes: `disp_0/NNNNNN_10.png`, 16 bits, d = value / 256, 0 where there
is none. Zip the folder's content and send it in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import write_png
from datagen.formats.picture import read_picture
from datagen.sources.registry import DataSource, open_source
from datagen.sources.stereo_frame import FileFrame, StereoFrame
from refine.method import Method
from stereoforge.errors import UsageError
from stereoforge.pipelines.prediction import Predictors
from stereoforge.progress import progress_bar

UNITS_PER_PX = 256
LARGEST = 65535
FOLDER = "disp_0"


def find_submission_frames(sources: Sequence[str]) -> list[StereoFrame]:
    """The frames to be submitted of the one KITTI set among the sources: its testing part, whose ground truth only the
    server has, or, where that is not there, its training part.

    Raises UsageError if there is not exactly one such set.
    """
    opened = [open_source(source) for source in sources]
    kitti = [source for source in opened if source.format.name.startswith("kitti")]
    if len(kitti) != 1:
        raise UsageError(f"--submission needs exactly one KITTI data set, there are {len(kitti)}")
    return _testing_frames(kitti[0]) or list(kitti[0].frames("test"))


def write_submission(frames: Sequence[StereoFrame], predictors: Predictors, method: Method, out: Path) -> int:
    """Predict, refine and write each frame; returns how many. Frames already written are written again."""
    folder = out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    with progress_bar() as progress:
        for frame in progress.track(frames, description="submission"):
            disparity = method.run(predictors.frame(frame)).disparity
            assert disparity is not None, f"{method.name} gives no disparity"
            write_png(folder / f"{frame.name}.png", encode_disparity(disparity))
    return len(frames)


def encode_disparity(disparity: NDArray[np.float32]) -> NDArray[np.uint16]:
    """(H, W) pixels to KITTI's units; the smallest is 1, since 0 says that there is none (NaN)."""
    units = np.clip(np.rint(np.nan_to_num(disparity, nan=0.0) * UNITS_PER_PX), 1, LARGEST)
    return np.where(np.isnan(disparity), 0, units).astype(np.uint16)


def _testing_frames(source: DataSource) -> list[StereoFrame]:
    folder = Path(source.location) / "testing"
    pairs = (("image_2", "image_3"), ("colored_0", "colored_1"))
    for left, right in pairs:
        if (folder / left).is_dir():
            return [
                _frame(path, folder / right / path.name) for path in sorted((folder / left).glob("*_10.png"))
            ]
    return []


def _frame(left: Path, right: Path) -> StereoFrame:
    def unknown() -> NDArray[np.float32]:
        return np.full(read_picture(left).shape[:2], np.nan, np.float32)

    return FileFrame(
        name=left.stem,
        scene_name=left.stem,
        read_left=partial(read_picture, left),
        read_right=partial(read_picture, right),
        read_disparity_left=unknown,
    )

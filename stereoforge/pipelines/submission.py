"""Results in the form the KITTI 2015 server takes: `disp_0/NNNNNN_10.png`, 16 bits, d = value / 256, 0 where there
is none. Zip the folder's content and send it in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import write_png
from datagen.sources.kitti import FORMATS, UNITS_PER_PX, testing_frames
from datagen.sources.registry import open_source
from datagen.sources.stereo_frame import StereoFrame
from refine.method import Method
from stereoforge.errors import UsageError
from stereoforge.pipelines.prediction import Predictors
from stereoforge.progress import progress_bar

LARGEST = 65535
FOLDER = "disp_0"


def find_submission_frames(sources: Sequence[str]) -> Sequence[StereoFrame]:
    """The frames to be submitted of the one KITTI set among the sources: its testing part, whose ground truth
    only the server has, or, where that is not there, its training part.

    Raises UsageError if there is not exactly one such set.
    """
    opened = [open_source(source) for source in sources]
    found = [source for source in opened if source.format in FORMATS]
    if len(found) != 1:
        raise UsageError(f"--submission needs exactly one KITTI data set, there are {len(found)}")
    return testing_frames(found[0]) or found[0].frames("test")


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

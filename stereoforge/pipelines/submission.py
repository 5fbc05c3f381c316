"""Results in the form that KITTI's servers take: `disp_0/NNNNNN_10.png` for 2015, `NNNNNN_10.png` in the root for 2012
(the readmes of their development kits), 16 bits, d = value / 256, 0 where there is none. Zip the folder's content and
send it in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.formats import write_png
from datagen.formats.disparity import PNG_UNITS_PER_PX, to_units
from datagen.sources.kitti import FORMATS, testing_frames
from datagen.sources.registry import open_source
from datagen.sources.stereo_frame import StereoFrame
from refine.method import Method
from stereoforge.errors import UsageError
from stereoforge.pipelines.prediction import Predictors
from stereoforge.progress import progress_bar

LARGEST = 65535
FOLDERS = {"kitti2012": "", "kitti2015": "disp_0"}
"""Where the files are in what each server takes, by the name of the format."""


@dataclass(frozen=True)
class Submission:
    """What is to be submitted."""

    frames: Sequence[StereoFrame]
    """The frames of the testing part, or those of the training part."""
    folder: str
    """The folder of the files, empty for the root."""
    note: str | None = None
    """A sentence for the user if these are not the frames that the server judges."""


def find_submission(sources: Sequence[str]) -> Submission:
    """What is to be submitted of the one KITTI set among the sources.

    It is the testing part, whose ground truth only the server has. Where that is not there, or the training part is
    named, it is the training part, and the note says so.

    Raises UsageError if there is not exactly one such set.
    """
    opened = [open_source(source) for source in sources]
    found = [source for source in opened if source.format in FORMATS]
    if len(found) != 1:
        raise UsageError(f"--submission needs exactly one KITTI data set, there are {len(found)}")
    kitti = found[0]
    folder = FOLDERS[kitti.format.name]
    frames = testing_frames(kitti)
    if frames:
        return Submission(frames, folder)
    named = Path(kitti.location).name == "training"
    why = "as its folder was named" if named else "since there is no testing part"
    note = (
        f"--submission has the training part of {kitti.location}, {why}; the server judges the testing part"
    )
    return Submission(kitti.frames("test"), folder, note)


def write_submission(submission: Submission, predictors: Predictors, method: Method, out: Path) -> int:
    """Predict, refine and write each frame; returns how many. Frames already written are written again."""
    folder = out / submission.folder
    folder.mkdir(parents=True, exist_ok=True)
    with progress_bar() as progress:
        for frame in progress.track(submission.frames, description="submission"):
            disparity = method.run(predictors.frame(frame)).disparity
            assert disparity is not None, f"{method.name} gives no disparity"
            write_png(folder / f"{frame.name}.png", encode_disparity(disparity))
    return len(submission.frames)


def encode_disparity(disparity: NDArray[np.float32]) -> NDArray[np.uint16]:
    """(H, W) pixels to KITTI's units; the smallest is 1, since 0 says that there is none (NaN)."""
    return to_units(np.minimum(disparity, LARGEST / PNG_UNITS_PER_PX), PNG_UNITS_PER_PX)

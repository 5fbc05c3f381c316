"""Training on pseudo labels: disparities that another method predicted, in place of a data set's own ground truth.

The paper trains GradNet for KITTI this way. Laser ground truth is too sparse for gradients, so the network learns from
the dense disparities of another stereo method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import overload

from datagen.formats.disparity import disparity_formats, read_disparity, read_disparity_map
from datagen.formats.impossible_disparity import PREDICTION_NOISE_PX
from datagen.sources.stereo_frame import FileFrame, StereoFrame
from stereoforge_kit.messages import listed
from training.data.pipeline import Source
from training.errors import TrainingError


def with_pseudo_labels(sources: Sequence[Source], folder: Path, units_per_px: float | None = None) -> Source:
    """The only source, with the disparities of a folder in place of its ground truth, and remarks on the first of them.

    Raises:
        TrainingError: several sources, or a frame that the folder has no disparity for.
    """
    if len(sources) != 1:
        raise TrainingError("training on pseudo labels needs exactly one data set")
    frames = PseudoLabelFrames(sources[0].frames, folder, units_per_px)
    return replace(sources[0], frames=frames, remarks=(*sources[0].remarks, *frames.remarks))


class PseudoLabelFrames(Sequence[StereoFrame]):
    """The frames of a data set, with the disparities of a folder as ground truth of their left views.

    A frame `a/b` takes `a/b.pfm` of the folder, `a/b.png` or another of `datagen.formats.disparity`'s formats.
    Disparities that cannot be become NaN. The right view then has no ground truth, and occlusion is unknown.
    """

    def __init__(
        self, frames: Sequence[StereoFrame], folder: Path, units_per_px: float | None = None
    ) -> None:
        """Find the file of every frame.

        Args:
            frames: Of the data set.
            folder: Of the disparities.
            units_per_px: What a pixel of disparity is stored as; None for what the formats say.

        Raises:
            TrainingError: names the first frame that the folder has no disparity for.
        """
        self._frames = frames
        self._files = [_file_of(folder, frame.name) for frame in frames]
        self._units_per_px = units_per_px

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the first file's numbers were taken for. Raises DatasetError for one that cannot be read."""
        first = self._files[0]
        return tuple(f"{first}: {remark}" for remark in read_disparity(first, self._units_per_px).remarks)

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
            read_disparity_left=partial(read_disparity_map, self._files[index], self._units_per_px),
            disparity_noise_px=PREDICTION_NOISE_PX,
        )


def _file_of(folder: Path, name: str) -> Path:
    endings = disparity_formats()
    for suffix in (*endings, *map(str.upper, endings)):
        path = folder / f"{name}{suffix}"
        if path.is_file():
            return path
    raise TrainingError(
        f"{folder}: has no disparity for the frame {name} ({name} with {listed(list(endings), most=len(endings))})"
    )

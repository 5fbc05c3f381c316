"""A frame from the files of one pair, whatever names and formats they have."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import DatasetError, FormatError
from datagen.formats.disparity import read_disparity, read_disparity_map
from datagen.formats.impossible_disparity import drop_impossible
from datagen.formats.picture import read_picture, read_raster
from datagen.ground_truth.from_disparity import occlusion_from_mask
from datagen.sources.stereo_frame import FileFrame

SCALE = "scale"
"""The option of a source that says what a pixel of disparity is stored as."""


@dataclass(frozen=True)
class PairFiles:
    """The files of one pair with ground truth."""

    name: str
    scene_name: str
    left: Path
    right: Path
    disparity: Path
    disparity_right: Path | None = None
    occlusion: Path | None = None
    """A mask that is 0 where the right view shows the point."""
    visible: Path | None = None
    """A mask that has its largest value where the right view shows the point."""
    valid: Path | None = None
    """A mask that is 0 where there is no disparity."""
    origin: str = ""
    """Where the pair is named, for messages."""

    def frame(self, units_per_px: float | None) -> FileFrame:
        """The frame, whose disparities are stored as so many units a pixel; None for what their formats say."""
        mask = self.occlusion or self.visible
        shows = self.occlusion is None
        return FileFrame(
            name=self.name,
            scene_name=self.scene_name,
            read_left=partial(read_picture, self.left),
            read_right=partial(read_picture, self.right),
            read_disparity_left=partial(_read_valid, self.disparity, units_per_px, self.valid),
            read_disparity_right=None
            if self.disparity_right is None
            else partial(read_disparity_map, self.disparity_right, units_per_px),
            read_occlusion_left=None
            if mask is None
            else partial(_read_labels, self.disparity, units_per_px, mask, shows),
            origin=self.origin,
        )


def units_of(location: str, scale: str | None) -> float | None:
    """The number of a source's option. Raises DatasetError for none."""
    if scale is None:
        return None
    try:
        units = float(scale)
    except ValueError:
        units = 0.0
    if not 0 < units < float("inf"):
        raise DatasetError(f"{location}: scale= takes a positive number, such as 256, not {scale!r}")
    return units


def reading_remarks(pair: PairFiles, units_per_px: float | None) -> str:
    """What the numbers of a disparity were taken for, as the end of a sentence; nothing if it cannot be read."""
    try:
        remarks = read_disparity(pair.disparity, units_per_px).remarks
    except DatasetError:
        return ""
    return "".join(f"; {pair.disparity.name}: {remark}" for remark in remarks)


def _read_valid(path: Path, units_per_px: float | None, valid: Path | None) -> NDArray[np.float32]:
    disparity = read_disparity_map(path, units_per_px)
    if valid is None:
        return disparity
    return np.where(_read_mask(valid, disparity) > 0, disparity, np.float32(np.nan))


def _read_labels(path: Path, units_per_px: float | None, mask: Path, shows: bool) -> NDArray[np.uint8]:
    """Occlusion labels from a mask of what the right view shows, or of what it does not."""
    disparity, _ = drop_impossible(read_disparity_map(path, units_per_px))
    values = _read_mask(mask, disparity)
    not_shown = values < values.max() if shows else values > 0
    return occlusion_from_mask(disparity, not_shown & ~np.isnan(disparity))


def _read_mask(path: Path, disparity: NDArray[np.float32]) -> NDArray[Any]:
    values = read_raster(path)
    mask = values if values.ndim == 2 else values[..., 0]
    if mask.shape != disparity.shape:
        raise FormatError(
            f"{path}: this mask is {mask.shape[1]}x{mask.shape[0]}, its disparity "
            f"{disparity.shape[1]}x{disparity.shape[0]}"
        )
    return mask

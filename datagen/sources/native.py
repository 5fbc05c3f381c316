"""StereoForge's own data sets (docs/conventions.md). Nothing is derived: they have all ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from datagen.dataset.layout import SPLITS, Layout
from datagen.dataset.samples import StereoDataset, StereoSample, open_layout
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import StereoFrame
from datagen.sources.webdataset import INDEX_NAME


def _recognises(root: Path) -> bool:
    return Layout(root).recipe.is_file() and not (root / INDEX_NAME).is_file()  # Shards have a recipe too.


def _find_frames(location: str, split: str, render_pass: str) -> Sequence[StereoFrame]:
    if split == "val" and not open_layout(location).committed_scenes(split):
        return []
    frames: Sequence[StereoSample] = StereoDataset(location, split, render_pass)
    return frames


FORMATS = (
    SourceFormat(
        "native", "a StereoForge data set", _recognises, partial(_find_frames, render_pass="clean"), SPLITS
    ),
    SourceFormat(
        "native-final",
        "a StereoForge data set (final pass)",
        lambda _: False,
        partial(_find_frames, render_pass="final"),
        SPLITS,
    ),
)

"""StereoForge's own data sets (docs/conventions.md). Nothing is derived: they have all ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from datagen.dataset.layout import RENDER_PASSES, SPLITS, Layout
from datagen.dataset.samples import StereoDataset, StereoSample, open_layout
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import StereoFrame
from datagen.sources.webdataset import INDEX_NAME


def _recognises(root: Path, render_pass: str) -> bool:
    """Whether it is a StereoForge data set; one with only the final pass is recognised by that pass."""
    if not Layout(root).recipe.is_file() or (root / INDEX_NAME).is_file():  # Shards have a recipe too.
        return False
    clean, final = ((root / RENDER_PASSES[name]).is_dir() for name in ("clean", "final"))
    return (final and not clean) == (render_pass == "final")


def _find_frames(location: str, split: str, render_pass: str) -> Sequence[StereoFrame]:
    if split == "val" and not open_layout(location).committed_scenes(split):
        return []
    frames: Sequence[StereoSample] = StereoDataset(location, split, render_pass)
    return frames


FORMATS = tuple(
    SourceFormat(
        name,
        title,
        partial(_recognises, render_pass=render_pass),
        partial(_find_frames, render_pass=render_pass),
        SPLITS,
    )
    for name, title, render_pass in (
        ("native", "a StereoForge data set", "clean"),
        ("native-final", "a StereoForge data set (final pass)", "final"),
    )
)

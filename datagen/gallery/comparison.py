"""Comparing the statistics of two data sets: the start of a domain-gap study."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import ks_2samp

from datagen.dataset.layout import SPLITS
from datagen.dataset.samples import StereoDataset, StereoSample, open_layout
from datagen.dataset.statistics import SetStatistics, measure
from datagen.errors import DatasetError
from datagen.gallery.page import LONGEST_SIDE_PX, MEASURED_FRAMES, Ticker, evenly_spaced, histograms
from datagen.recipe.recipe import read_recipe
from stereoforge_kit.files import write_text
from stereoforge_kit.viewing import Picture, render_page, shrunk
from stereoforge_kit.viewing.plots import svg

SHOWN_FRAMES = 6
"""Number of pictures of each set."""


@dataclass(frozen=True)
class _ComparedSet:
    """One of the two sets."""

    name: str
    """The folder's name, with as much of its path as makes it differ from the other's."""
    lead: str
    samples: list[StereoSample]
    pictures: list[Picture]


@dataclass(frozen=True)
class _Row:
    """One quantity in both sets."""

    label: str
    first: str
    second: str
    distance: str


def write_comparison(
    first: Path | str,
    second: Path | str,
    out_html: Path | str,
    *,
    scenes: int = SHOWN_FRAMES,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a page that compares the statistics of two data sets, with all their splits together.

    Args:
        first, second: The data sets' folders.
        out_html: The file to write. It needs no other file and opens from disk.
        scenes: Number of pictures of each set, at most `SHOWN_FRAMES`.
        progress: Called with (frames read, frames in all).

    Raises:
        DatasetError: For a folder that is no data set or has no finished scene, or for damaged files.
    """
    names = _names(Path(first), Path(second))
    compared = [
        _compared_set(Path(root), name, min(scenes, SHOWN_FRAMES))
        for root, name in zip((first, second), names, strict=True)
    ]
    tick = Ticker(sum(len(one.samples) for one in compared), progress)
    statistics = {one.name: measure(map(tick, one.samples)) for one in compared}
    page = render_page(
        "datagen.gallery",
        "comparison.html",
        title=f"{names[0]} and {names[1]}",
        compared=compared,
        rows=_rows(*statistics.values()),
        plots=[svg(figure) for figure in histograms(statistics)],
        measured=[len(one) for one in statistics.values()],
    )
    write_text(Path(out_html), page)


def _names(first: Path, second: Path) -> tuple[str, str]:
    """The folders' names, with as much of their paths as tells them apart."""
    one, two = first.resolve().parts, second.resolve().parts
    for length in range(1, max(len(one), len(two)) + 1):
        names = "/".join(one[-length:]), "/".join(two[-length:])
        if names[0] != names[1]:
            return names
    return f"{names[0]} (1)", f"{names[1]} (2)"


def _compared_set(root: Path, name: str, shown: int) -> _ComparedSet:
    layout = open_layout(root)
    recipe = read_recipe(layout.recipe)
    splits = [split for split in SPLITS if layout.committed_scenes(split)]
    if not splits:
        raise DatasetError(f"{layout.root}: has no finished scene to compare")
    frames = [sample for split in splits for sample in StereoDataset(root, split, recipe.passes[0])]
    lead = f"{recipe.family} at {recipe.world.width} × {recipe.world.height}, {len(frames)} stereo pairs"
    pictures = [shrunk(sample.left, LONGEST_SIDE_PX) for sample in evenly_spaced(frames, shown)]
    return _ComparedSet(name, lead, evenly_spaced(frames, MEASURED_FRAMES), pictures)


def _rows(first: SetStatistics, second: SetStatistics) -> list[_Row]:
    """Median and spread of every quantity in both sets, and the distance of the two distributions."""
    quantities = (
        ("Disparity of a pixel, px", "disparity", 1.0, 1),
        ("Occluded pixels, %", "occluded", 100.0, 1),
        ("Pixels out of frame, %", "out_of_frame", 100.0, 1),
        ("Objects in view", "visible_objects", 1.0, 0),
        ("Textured pixels, %", "textured", 100.0, 0),
    )
    rows = []
    for label, name, factor, digits in quantities:
        values = [factor * np.asarray(getattr(one, name), np.float64) for one in (first, second)]
        distance = float(ks_2samp(*values).statistic)
        rows.append(_Row(label, _spread(values[0], digits), _spread(values[1], digits), f"{distance:.2f}"))
    return rows


def _spread(values: NDArray[np.float64], digits: int) -> str:
    low, middle, high = np.percentile(values, (5, 50, 95))
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"

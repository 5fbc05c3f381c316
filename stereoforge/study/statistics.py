"""What a domain's frames are like: the distributions by which domains differ."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cattrs
import numpy as np

from datagen.dataset.statistics import PIXEL_STEP, textured_share
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME
from datagen.sources.stereo_frame import StereoFrame
from stereoforge_kit.files import write_text

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
BIN_PX = 2.0
LARGEST_PX = 512.0
"""Larger disparities fall into the last bin."""


@dataclass(frozen=True)
class DomainStatistics:
    """Of the left views' ground truth; NaN where the data set does not tell."""

    frames: int
    quantiles: tuple[float, ...]
    """Of the disparity in pixels, at `QUANTILES`."""
    histogram: tuple[float, ...]
    """Share of the pixels in bins of `BIN_PX` from 0 on, up to the last that is not empty."""
    slope: float
    """Mean |dx| + |dy| of the disparity where it is no discontinuity, pixels a pixel."""
    discontinuities: float
    """Share of pixels with a jump to a neighbour."""
    occluded: float
    """Share of pixels that are occluded in the right view."""
    out_of_frame: float
    """Share of pixels outside the right image."""
    textured: float
    """Share of pixels with texture around them (`datagen.dataset.statistics`)."""


def describe(frames: Sequence[StereoFrame]) -> DomainStatistics:
    """Read and measure frames."""
    disparities, rows = [], []
    for frame in frames:
        disparity, labels = frame.disparity_left, frame.occlusion_left
        disparities.append(disparity[::PIXEL_STEP, ::PIXEL_STEP].ravel())
        smooth, known = frame.gradient_valid_left, np.isfinite(disparity)
        rows.append(
            (
                np.abs(frame.gradient_left[smooth]).sum(axis=1).mean() if smooth.any() else math.nan,
                1 - smooth[:-1, :-1].mean() if known.all() else math.nan,
                math.nan if labels is None else (labels == OCCLUDED).mean(),
                math.nan if labels is None else (labels == OUT_OF_FRAME).mean(),
                textured_share(frame.left),
            )
        )
    whole = np.concatenate(disparities)
    whole = whole[np.isfinite(whole)]
    edges = np.arange(0, LARGEST_PX + BIN_PX, BIN_PX)
    counts, _ = np.histogram(np.clip(whole, 0, LARGEST_PX - BIN_PX / 2), edges)
    filled = int(np.flatnonzero(counts)[-1]) + 1 if counts.any() else 0
    means = (float(np.mean(column)) for column in zip(*rows, strict=True))
    return DomainStatistics(
        len(frames),
        tuple(float(value) for value in np.quantile(whole, QUANTILES)),
        tuple(float(count / whole.size) for count in counts[:filled]),
        *means,
    )


def write_statistics(path: Path, statistics: DomainStatistics) -> None:
    """Write statistics as JSON, in one step."""
    write_text(path, json.dumps(asdict(statistics), indent=1) + "\n")


def read_statistics(path: Path) -> DomainStatistics:
    """Read what `write_statistics` wrote."""
    return cattrs.structure(json.loads(path.read_text(encoding="utf-8")), DomainStatistics)

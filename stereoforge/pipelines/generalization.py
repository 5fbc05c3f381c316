"""The field's protocol for networks on sets that they were not trained on.

As stereo-toolbox's `generalization_eval` has it, so that its published tables and ours can be laid side by side: ground
truth above 0 and below 191 px counts; an outlier is off by more than 3 px (KITTI), 2 px (Middlebury) or 1 px (ETH3D);
every figure is the mean over the frames of the frame's own figure, not over the pixels of all frames.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from refine.evaluation.pooling import MethodScore, RegionScore
from refine.evaluation.results import EvaluatedSet
from refine.method import EvaluationFrame
from stereoforge_kit.files import write_text

OUTLIER_PX = {"kitti": 3.0, "middlebury": 2.0, "eth3d": 1.0}
"""By how the name of a set's family begins."""
OTHER_OUTLIER_PX = 3.0
"""In all other sets."""
LARGEST_PX = 191.0
"""Ground truth of this and more does not count."""
COLUMNS = ("set", "method", "frames", "outlier_px", "epe", "occluded", "visible", "all")
"""Of the file; the last three are outliers in per cent."""


def outlier_px(family: str) -> float:
    """By how many pixels an outlier is off in a set of this family.

    >>> outlier_px("kitti2015"), outlier_px("middlebury2006"), outlier_px("eth3d"), outlier_px("indoor")
    (3.0, 2.0, 1.0, 3.0)
    """
    return next((px for name, px in OUTLIER_PX.items() if family.startswith(name)), OTHER_OUTLIER_PX)


def counted_truth(frame: EvaluationFrame) -> EvaluationFrame:
    """The frame with the ground truth that the protocol counts."""
    counts = (frame.truth > 0) & (frame.truth < LARGEST_PX)
    return replace(frame, truth=np.where(counts, frame.truth, np.nan).astype(frame.truth.dtype))


@dataclass(frozen=True)
class GeneralizationRow:
    """One method on one set."""

    set: str
    method: str
    frames: int
    outlier_px: float
    epe: float
    """Mean |d - d*| in pixels."""
    occluded: float
    visible: float
    all: float
    """Outliers in per cent of those pixels; NaN where no frame has any."""


def generalization_rows(evaluated: EvaluatedSet) -> list[GeneralizationRow]:
    """The figures of every method on a set that was evaluated with `counted_truth` and `outlier_px`."""
    evaluation = evaluated.evaluation
    rows = []
    for name, label in evaluation.labels.items():
        scores = [frame.methods[name] for frame in evaluation.frames if name in frame.methods]
        if not scores or all(np.isnan(score.regions["all"].bad) for score in scores):
            continue
        occluded, visible, everywhere = (
            100 * _mean(shares) for shares in zip(*(_outliers(score) for score in scores), strict=True)
        )
        rows.append(
            GeneralizationRow(
                evaluated.name,
                label,
                len(scores),
                evaluation.options.bad_threshold,
                _mean([score.regions["all"].epe for score in scores]),
                occluded,
                visible,
                everywhere,
            )
        )
    return rows


def write_generalization(rows: Sequence[GeneralizationRow], folder: Path) -> Path:
    """Write rows as generalization.csv into a folder, and return the file."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        writer.writerow([getattr(row, name) for name in COLUMNS])
    path = folder / "generalization.csv"
    write_text(path, text.getvalue())
    return path


def _outliers(score: MethodScore) -> tuple[float, float, float]:
    """Shares of outliers among the occluded, the visible and all pixels of a frame."""
    everywhere, occluded = score.regions["all"], score.regions["occ"]
    visible = everywhere.pixels - occluded.pixels
    bad = _bad(everywhere) - _bad(occluded)
    return occluded.bad, bad / visible if visible else float("nan"), everywhere.bad


def _bad(region: RegionScore) -> float:
    """Number of outliers; none where there is no pixel."""
    return region.bad * region.pixels if region.pixels else 0.0


def _mean(values: Sequence[float]) -> float:
    """The mean of those that are numbers: a frame without such pixels does not count."""
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")

"""An evaluation's numbers as plain rows: the one source of the report's tables, `results.csv` and
`results.json`."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from refine.evaluation import REGIONS, Evaluation, MethodScore
from refine.metrics import SparsificationCurve, optimal_curve

MEASURES = (
    *(f"{measure}_{region}" for region in REGIONS for measure in ("bad", "epe", "pixels", "missing")),
    "gradient_masked",
    "gradient_all",
    "seconds",
    "auc",
)
"""Columns of numbers. bad: share 0..1; epe: pixels; pixels, missing: counts; gradient: pixels a pixel;
seconds: a frame; auc: 0..1."""


@dataclass(frozen=True)
class ResultRow:
    """The measures of one method, or one confidence measure, over one frame or the whole set."""

    order: int | None
    """Place of the frame in the set, from 0; None for the whole set."""
    frame: str
    """The frame's name; empty for the whole set."""
    kind: str
    """"method" or "confidence"."""
    name: str
    values: Mapping[str, float]
    """Some of `MEASURES`; NaN where a mask had no pixels."""


def result_rows(evaluation: Evaluation) -> Iterator[ResultRow]:
    """Every number of an evaluation, the whole set first, then frame by frame in the order they came."""
    for name, score in evaluation.scores.items():
        yield ResultRow(None, "", "method", name, _method_values(score))
    for name, auc in mean_aucs(evaluation).items():
        yield ResultRow(None, "", "confidence", name, {"auc": auc})
    for order, frame in enumerate(evaluation.frames):
        for name, score in frame.methods.items():
            yield ResultRow(order, frame.name, "method", name, _method_values(score))
        for name, auc in frame.aucs.items():
            yield ResultRow(order, frame.name, "confidence", name, {"auc": auc})


def mean_aucs(evaluation: Evaluation) -> dict[str, float]:
    """Each confidence measure's area under the sparsification curve, mean over the frames that have it.

    Frames without ground truth do not count. "random" (a random order) and "optimal" (the ground truth's
    order) are the bounds.
    """
    names = dict.fromkeys(name for frame in evaluation.frames for name in frame.aucs)
    return {name: _mean([frame.aucs.get(name, math.nan) for frame in evaluation.frames]) for name in names}


def mean_curves(evaluation: Evaluation) -> dict[str, SparsificationCurve]:
    """Each confidence measure's sparsification curve and the bounds', averaged over the frames at equal
    shares."""
    curves: dict[str, list[SparsificationCurve]] = {}
    for frame in evaluation.frames:
        if math.isnan(frame.initial_bad):
            continue
        for name, curve in frame.curves.items():
            curves.setdefault(name, []).append(curve)
        curves.setdefault("optimal", []).append(optimal_curve(frame.initial_bad))
    return {
        name: SparsificationCurve(each[0].removed, np.mean([curve.bad_rate for curve in each], axis=0))
        for name, each in curves.items()
    }


def results_csv(evaluation: Evaluation) -> str:
    """One line a row, full precision, empty cells where a row has no such measure or it is NaN."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["frame", "kind", "name", *MEASURES])
    for row in result_rows(evaluation):
        cells = [row.values.get(measure, math.nan) for measure in MEASURES]
        numbers = ["" if math.isnan(cell) else repr(cell) for cell in cells]
        writer.writerow([row.frame, row.kind, row.name, *numbers])
    return buffer.getvalue()


def results_json(evaluation: Evaluation, about: Mapping[str, Any]) -> str:
    """The same rows as nested objects, NaN as null, with the options and what `about` says of their
    origin."""
    document: dict[str, Any] = {
        "about": dict(about),
        "options": asdict(evaluation.options),
        "skipped": evaluation.skipped,
        "set": {"methods": {}, "confidences": {}},
        # A list: frames of two data sets may share a name.
        "frames": [{"name": frame.name, "methods": {}, "confidences": {}} for frame in evaluation.frames],
    }
    for row in result_rows(evaluation):
        place = document["set"] if row.order is None else document["frames"][row.order]
        numbers = {key: None if math.isnan(value) else value for key, value in row.values.items()}
        place[f"{row.kind}s"][row.name] = numbers
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def _method_values(score: MethodScore) -> dict[str, float]:
    values: dict[str, float] = {}
    for name, region in score.regions.items():
        for measure, value in asdict(region).items():
            values[f"{measure}_{name}"] = value
    return values | {
        "gradient_masked": score.gradient_masked,
        "gradient_all": score.gradient_all,
        "seconds": score.seconds,
    }


def _mean(values: list[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan

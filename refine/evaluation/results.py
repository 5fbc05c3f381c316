"""The numbers of evaluations as plain rows: the source of the report's tables, `results.csv` and `results.json`."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from refine.evaluation.evaluate import Evaluation
from refine.evaluation.pooling import MEASURES
from refine.metrics import SparsificationCurve, optimal_curve

COLUMNS = (*MEASURES, "auc")
"""A method's measures, and a confidence measure's mean area under the sparsification curve (0..1)."""


@dataclass(frozen=True)
class EvaluatedSet:
    """One data set's evaluation, with what it is."""

    name: str
    """For readers; no two sets of a report share one."""
    evaluation: Evaluation
    family: str = ""
    """What kind of world, to find the paper's counterpart (`refine.report.published.counterpart`); empty if unknown."""
    split: str = "test"
    facts: Mapping[str, str] = field(default_factory=dict)
    """Where it comes from, for example {"Folder": "..."}."""

    @property
    def is_kitti(self) -> bool:
        """Whether it is in KITTI's style, with cars told from the rest."""
        pools = (pool for frame in self.evaluation.frames for pool in frame.pools.values())
        return self.family.startswith("kitti") or any(pool.d1.pixels[1] > 0 for pool in pools)


@dataclass(frozen=True)
class ResultRow:
    """The measures of one method, or one confidence measure, over one frame or the whole set."""

    order: int | None
    """Place of the frame in the set, from 0; None for the whole set."""
    frame: str
    """The frame's name; empty for the whole set."""
    kind: str
    """"method"; "confidence", of the initial disparity; "refined_confidence", of the judged method's."""
    name: str
    values: Mapping[str, float]
    """Some of `COLUMNS`; NaN where a mask had no pixels."""


def result_rows(evaluation: Evaluation) -> Iterator[ResultRow]:
    """Every number of an evaluation, the whole set first, then frame by frame in the order they came."""
    for name, score in evaluation.scores.items():
        yield ResultRow(None, "", "method", name, score.measures())
    for name, auc in mean_aucs(evaluation).items():
        yield ResultRow(None, "", "confidence", name, {"auc": auc})
    for name, auc in mean_refined_aucs(evaluation).items():
        yield ResultRow(None, "", "refined_confidence", name, {"auc": auc})
    for order, frame in enumerate(evaluation.frames):
        for name, score in frame.methods.items():
            yield ResultRow(order, frame.name, "method", name, score.measures())
        for name, auc in frame.aucs.items():
            yield ResultRow(order, frame.name, "confidence", name, {"auc": auc})
        for name, auc in frame.refined_aucs.items():
            yield ResultRow(order, frame.name, "refined_confidence", name, {"auc": auc})


def mean_aucs(evaluation: Evaluation) -> dict[str, float]:
    """Each confidence measure's area under the sparsification curve, mean over the frames that have it.

    Frames without ground truth do not count. "random" (a random order) and "optimal" (the ground truth's
    order) are the bounds.
    """
    return _means([frame.aucs for frame in evaluation.frames])


def mean_refined_aucs(evaluation: Evaluation) -> dict[str, float]:
    """The same of the judged method's disparity; empty where its deviations were not sampled."""
    return _means([frame.refined_aucs for frame in evaluation.frames])


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


def results_csv(sets: Sequence[EvaluatedSet]) -> str:
    """One line a row, full precision, empty cells where a row has no such measure or it is NaN."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["set", "frame", "kind", "name", *COLUMNS])
    for each in sets:
        for row in result_rows(each.evaluation):
            cells = [row.values.get(measure, math.nan) for measure in COLUMNS]
            numbers = ["" if math.isnan(cell) else repr(cell) for cell in cells]
            writer.writerow([each.name, row.frame, row.kind, row.name, *numbers])
    return buffer.getvalue()


def results_json(sets: Sequence[EvaluatedSet], about: Mapping[str, Any]) -> str:
    """The same rows as nested objects, NaN as null, with the options and what `about` says of their
    origin."""
    document = {"about": dict(about), "sets": [_set_document(each) for each in sets]}
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def null_nan(value: float) -> float | None:
    """JSON has no NaN."""
    return None if math.isnan(value) else value


def _set_document(each: EvaluatedSet) -> dict[str, Any]:
    evaluation = each.evaluation
    document: dict[str, Any] = {
        "name": each.name,
        "family": each.family,
        "split": each.split,
        "facts": dict(each.facts),
        "options": asdict(evaluation.options),
        "skipped": evaluation.skipped,
        "methods": {},
        "confidences": {},
        "refined_confidences": {},
        # A list: two frames may share a name.
        "frames": [
            {"name": frame.name, "methods": {}, "confidences": {}, "refined_confidences": {}}
            for frame in evaluation.frames
        ],
    }
    for row in result_rows(evaluation):
        place = document if row.order is None else document["frames"][row.order]
        place[f"{row.kind}s"][row.name] = {key: null_nan(value) for key, value in row.values.items()}
    return document


def _means(areas: Sequence[Mapping[str, float]]) -> dict[str, float]:
    names = dict.fromkeys(name for each in areas for name in each)
    return {name: _mean([each.get(name, math.nan) for each in areas]) for name in names}


def _mean(values: list[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan

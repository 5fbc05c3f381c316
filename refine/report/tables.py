"""The report's tables: numbers as cells with the text to read and the full value to sort by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from refine.evaluation.bootstrap import REFERENCE, Bootstrap
from refine.evaluation.evaluate import Evaluation, FrameScore
from refine.evaluation.pooling import MethodScore
from refine.evaluation.results import EvaluatedSet, mean_aucs, mean_refined_aucs
from refine.report.published import PAPER, counterpart

CONFIDENCE_LABELS = {
    "confnet": "ConfNet",
    "rdf": "Random forest",
    "posterior": "Posterior deviation",
    "lrc": "Left-right consistency",
    "random": "Random order",
    "optimal": "Optimal order",
}
BOUNDS = ("random", "optimal")


@dataclass(frozen=True)
class Cell:
    """One number: what is read and what is sorted by (the full value, as in results.csv)."""

    text: str
    value: str
    best: bool = False
    note: str = ""
    """Smaller, under the text."""


@dataclass(frozen=True)
class Table:
    """A table: headings, and rows of a name and cells."""

    headings: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]


@dataclass(frozen=True)
class Tile:
    """One headline number."""

    value: str
    label: str


def number(value: float, digits: int = 2, scale: float = 1.0, best: bool = False) -> Cell:
    """A cell with `value * scale` rounded for reading; a dash where the value is NaN."""
    if math.isnan(value):
        return Cell("–", "")
    return Cell(f"{value * scale:.{digits}f}", repr(value), best)


def percent(value: float, best: bool = False) -> Cell:
    """A cell with a share in per cent."""
    return number(value, digits=2, scale=100, best=best)


def summary_tiles(evaluation: Evaluation) -> list[Tile]:
    """The headline: what refinement changed, and how good the confidence is."""
    tiles = []
    start, end = evaluation.scores.get("regressor"), evaluation.scores.get("ours")
    if start is not None and end is not None:
        before, after = start.measures(), end.measures()
        threshold = f"{evaluation.options.bad_threshold:g}"
        for label, measure, scale, unit in (
            ("end-point error, px", "epe_all", 1, ""),
            (f"pixels off by more than {threshold} px", "bad_all", 100, " %"),
            ("the same where occluded", "bad_occ", 100, " %"),
            ("gradient error", "gradient_masked", 1, ""),
        ):
            old, new = before[measure], after[measure]
            if not math.isnan(old):
                digits = 1 if scale == 100 else 2
                tiles.append(Tile(f"{old * scale:.{digits}f} → {new * scale:.{digits}f}{unit}", label))
    aucs = mean_aucs(evaluation)
    if "confnet" in aucs and aucs["random"] > aucs["optimal"]:
        share = (aucs["random"] - aucs["confnet"]) / (aucs["random"] - aucs["optimal"])
        tiles.append(
            Tile(f"{share * 100:.0f} %", "of the way from a random to the optimal order: ConfNet's AUC")
        )
    return tiles


def overview_table(sets: Sequence[EvaluatedSet], intervals: Sequence[Bootstrap]) -> Table | None:
    """One row a set: the errors before and after, the ratio with its interval, and the paper's ratio."""
    rows = []
    for each, known in zip(sets, intervals, strict=True):
        scores = each.evaluation.scores
        if REFERENCE not in scores or "ours" not in scores:
            continue
        before, after = scores[REFERENCE].measures(), scores["ours"].measures()
        beside = counterpart(each.family, each.split, 2)
        cells: list[Cell] = []
        for measure, digits, scale in (("epe_all", 2, 1), ("bad_all", 1, 100), ("gradient_masked", 3, 1)):
            interval = known.ratios["ours"][measure]
            ratio = after[measure] / before[measure] if before[measure] else math.nan
            paper = math.nan
            if beside is not None:
                printed = PAPER[beside]
                paper = printed["ours"].value(measure) / printed[REFERENCE].value(measure)
            start, end = (number(each[measure], digits, scale) for each in (before, after))
            range_ = "" if math.isnan(interval.low) else f"{interval.low:.2f}–{interval.high:.2f}"
            cells += [
                replace(end, text=f"{start.text} → {end.text}"),
                replace(number(ratio), note=range_),
                number(paper),
            ]
        rows.append((each.name, tuple(cells)))
    if not rows:
        return None
    headings = (
        "Data set",
        "EPE, px",
        "ratio",
        "paper's",
        "> 1 px, %",
        "ratio",
        "paper's",
        "gradient",
        "ratio",
        "paper's",
    )
    return Table(headings, tuple(rows))


def error_table(evaluation: Evaluation) -> Table:
    """Pooled errors, a row a method; the best of those that do not see the ground truth in bold."""
    threshold = f"{evaluation.options.bad_threshold:g}"
    columns = {name: _error_values(score) for name, score in evaluation.scores.items()}
    rivals = [values for name, values in columns.items() if name not in evaluation.upper_bounds]
    best = [
        min((value for value in column if not math.isnan(value)), default=math.nan)
        for column in zip(*rivals, strict=True)
    ]
    rows = []
    for name, values in columns.items():
        rival = name not in evaluation.upper_bounds
        scales = (100, 1, 100, 1, 1, 1)
        cells = [
            number(value, digits=2 if scale == 100 else 3, scale=scale, best=rival and value == lowest)
            for value, lowest, scale in zip(values, best, scales, strict=True)
        ]
        rows.append((evaluation.labels[name], (*cells, number(evaluation.scores[name].seconds, digits=2))))
    return Table(
        (
            "Method",
            f"> {threshold} px, all, %",
            "EPE, all, px",
            f"> {threshold} px, occ., %",
            "EPE, occ., px",
            "gradient, smooth",
            "gradient, all",
            "s a frame",
        ),
        tuple(rows),
    )


def missing_notes(evaluation: Evaluation) -> list[str]:
    """A sentence for each method without a disparity at some pixels, whose EPE is therefore of the others
    only."""
    notes = []
    for name, score in evaluation.scores.items():
        region = score.regions["all"]
        if region.missing:
            share = region.missing / region.pixels * 100
            notes.append(
                f"{evaluation.labels[name]} gives no disparity at {share:.1f} % of the pixels: they count as bad, "
                "and its EPE is that of the others."
            )
    return notes


def confidence_table(evaluation: Evaluation) -> Table:
    """Mean area under the sparsification curve, and on how many frames ConfNet beats each other measure."""
    aucs = mean_aucs(evaluation)
    room = aucs["random"] - aucs["optimal"]
    rivals = aucs.keys() - {"confnet", *BOUNDS}
    compared = "confnet" in aucs and bool(rivals)
    rows = []
    for name, auc in sorted(aucs.items(), key=lambda item: item[1]):
        share = (aucs["random"] - auc) / room if room > 0 else math.nan
        cells = [number(auc, 4), number(share, 1, scale=100)]
        if compared:
            beaten = _share_beaten(evaluation, name) if name in rivals else math.nan
            cells.append(number(beaten, 0, scale=100))
        rows.append((CONFIDENCE_LABELS.get(name, name), tuple(cells)))
    headings = ("Order of removal", "mean AUC", "of random → optimal, %", "ConfNet is better, % of frames")
    return Table(headings if compared else headings[:-1], tuple(rows))


def refined_confidence_table(evaluation: Evaluation) -> Table | None:
    """Mean area under the curve of the refined disparity, by the posterior's deviation and by ConfNet."""
    aucs = mean_refined_aucs(evaluation)
    if not aucs:
        return None
    room = aucs["random"] - aucs["optimal"]
    rows = []
    for name, auc in sorted(aucs.items(), key=lambda item: item[1]):
        share = (aucs["random"] - auc) / room if room > 0 else math.nan
        rows.append((CONFIDENCE_LABELS.get(name, name), (number(auc, 4), number(share, 1, scale=100))))
    return Table(("Order of removal", "mean AUC", "of random → optimal, %"), tuple(rows))


def _share_beaten(evaluation: Evaluation, name: str) -> float:
    """Share of the frames with both measures on which ConfNet's area is the smaller."""
    pairs = [
        (frame.aucs["confnet"], frame.aucs[name])
        for frame in evaluation.frames
        if {"confnet", name} <= frame.aucs.keys()
    ]
    return sum(ours < theirs for ours, theirs in pairs) / len(pairs) if pairs else math.nan


def frame_table(evaluation: Evaluation) -> Table:
    """One row a frame: the initial and the judged method's errors, and ConfNet's area under the curve if there is a
    ConfNet."""
    judged = evaluation.labels[evaluation.judged].lower()
    after = (f"bad {judged}, %", f"EPE {judged}") if evaluation.refines else ()
    areas = ("AUC", "optimal AUC") if any("confnet" in frame.curves for frame in evaluation.frames) else ()
    rows = tuple(
        (
            frame.name,
            _initial_cells(frame)
            + (_judged_cells(frame.methods[evaluation.judged]) if after else ())
            + (_area_cells(frame) if areas else ()),
        )
        for frame in evaluation.frames
    )
    return Table(("Frame", "bad before, %", "EPE before", *after, *areas), rows)


def _initial_cells(frame: FrameScore) -> tuple[Cell, ...]:
    initial = frame.methods.get("regressor")
    return percent(frame.initial_bad), number(initial.regions["all"].epe if initial else math.nan, 3)


def _judged_cells(score: MethodScore) -> tuple[Cell, ...]:
    return percent(score.regions["all"].bad), number(score.regions["all"].epe, 3)


def _area_cells(frame: FrameScore) -> tuple[Cell, ...]:
    return number(frame.aucs.get("confnet", math.nan), 4), number(frame.optimal_auc, 4)


def _error_values(score: MethodScore) -> tuple[float, ...]:
    measures = score.measures()
    return tuple(
        measures[name]
        for name in ("bad_all", "epe_all", "bad_occ", "epe_occ", "gradient_masked", "gradient_all")
    )

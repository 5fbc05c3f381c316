"""Tables 1-6 of the paper for one data set: our numbers, their confidence, and what the paper prints. Methods that the
paper does not have end Tables 2, 4 and 6.

The paper's absolute numbers are of other data and a larger network, so beside each stands the ratio to its own
regressor's, here and there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from refine.evaluation.bootstrap import REFERENCE, UNKNOWN, Bootstrap, Interval, bootstrap
from refine.evaluation.results import EvaluatedSet
from refine.report.published import KITTI_OTHERS, NAN, PAPER, SAME_IN_PAPER, PaperScore, counterpart

MAIN_ROWS = ("regressor", "wmf", "regressor_f", "ours_quadratic", "ours")
REFINEMENT_ROWS = ("color", "tgv", "fbs", "grad", "ours_quadratic", "ours")
PAPER_ROWS = {*MAIN_ROWS, *REFINEMENT_ROWS, "gradnet", "ours_conf_gt"}


@dataclass(frozen=True)
class MeasureColumn:
    """How one measure is printed."""

    measure: str
    """As in `refine.evaluation.pooling.MEASURES`."""
    heading: str
    scale: float = 1.0
    digits: int = 2
    compared: bool = True
    """Whether its ratio to the regressor's means something."""


@dataclass(frozen=True)
class PaperCell:
    """One measure of one method; NaN for what is not known."""

    value: float = NAN
    interval: Interval = UNKNOWN
    ratio: float = NAN
    """To the regressor's."""
    ratio_interval: Interval = UNKNOWN
    paper: float = NAN
    paper_ratio: float = NAN


@dataclass(frozen=True)
class PaperRow:
    """One method."""

    method: str
    """Its name in the files."""
    label: str
    cells: tuple[PaperCell, ...]
    upper_bound: bool = False


@dataclass(frozen=True)
class PaperTable:
    """One of the paper's tables for one data set."""

    number: int
    title: str
    columns: tuple[MeasureColumn, ...]
    rows: tuple[PaperRow, ...]
    counterpart: str | None
    """The paper's data set in the columns beside ours."""

    @property
    def has_paper(self) -> bool:
        """Whether any of its rows has a number printed in the paper."""
        return any(not math.isnan(cell.paper) for row in self.rows for cell in row.cells)


@dataclass(frozen=True)
class _Layout:
    number: int
    title: str
    methods: tuple[str, ...]
    columns: tuple[MeasureColumn, ...]
    compares: bool = True
    """Whether it says nothing about one method alone."""
    others: bool = False
    """Whether methods that no table of the paper has end this one."""

    def rows(self, evaluated: Iterable[str]) -> tuple[str, ...]:
        """Those of the evaluated methods that it shows, in order."""
        names = list(evaluated)
        others = (name for name in names if self.others and name not in PAPER_ROWS)
        return (*(name for name in self.methods if name in names), *others)


def _layouts(threshold: float) -> tuple[_Layout, ...]:
    bad = f"> {threshold:g} px, %"
    bad_all = MeasureColumn("bad_all", f"{bad}, all", 100)
    epe_all = MeasureColumn("epe_all", "EPE, px, all")
    gradient = MeasureColumn("gradient_masked", "gradient error, smooth", digits=3)
    return (
        _Layout(
            1,
            "Gradients: GradNet against the regressor's own",
            ("regressor", "gradnet"),
            (gradient, MeasureColumn("gradient_all", "gradient error, all pixels", digits=3)),
        ),
        _Layout(
            2,
            "Disparity, occluded and all pixels",
            MAIN_ROWS,
            (
                MeasureColumn("bad_occ", f"{bad}, occluded", 100),
                MeasureColumn("epe_occ", "EPE, px, occluded"),
                bad_all,
                epe_all,
            ),
            compares=False,
            others=True,
        ),
        _Layout(
            3,
            "Disparity, and what a perfect confidence would give",
            (*MAIN_ROWS, "ours_conf_gt"),
            (bad_all, epe_all),
        ),
        _Layout(4, "Gradient error of the disparity after refinement", MAIN_ROWS, (gradient,), others=True),
        _Layout(
            5,
            "Ways to refine",
            REFINEMENT_ROWS,
            (epe_all, bad_all, gradient, MeasureColumn("seconds", "s a frame", compared=False)),
        ),
        _Layout(
            6,
            "KITTI outliers (> 3 px and > 5 %)",
            (*MAIN_ROWS, "ours_conf_gt"),
            (
                MeasureColumn("d1_bg", "D1 background, %", 100),
                MeasureColumn("d1_fg", "D1 foreground, %", 100),
                MeasureColumn("d1_all", "D1 all, %", 100),
            ),
            compares=False,
            others=True,
        ),
    )


def paper_tables(each: EvaluatedSet, resamples: Bootstrap | None = None) -> tuple[PaperTable, ...]:
    """The tables that say something: 1-5, and 6 for sets in KITTI's style. A comparison needs two methods.

    Args:
        each: The set.
        resamples: Its confidence intervals, made here if not given.
    """
    known = resamples or bootstrap(each.evaluation)
    return tuple(
        _table(each, known, layout)
        for layout in _layouts(each.evaluation.options.bad_threshold)
        if (layout.number != 6 or each.is_kitti)
        and len(layout.rows(each.evaluation.scores)) >= 1 + layout.compares
    )


def _table(each: EvaluatedSet, known: Bootstrap, layout: _Layout) -> PaperTable:
    evaluation = each.evaluation
    beside = counterpart(each.family, each.split, layout.number)
    printed: Mapping[str, PaperScore] = PAPER[beside] if beside else {}
    rows = [
        PaperRow(
            method,
            evaluation.labels[method],
            tuple(_cell(each, known, printed, method, column) for column in layout.columns),
            method in evaluation.upper_bounds,
        )
        for method in layout.rows(evaluation.scores)
    ]
    if layout.number == 6 and beside == "KITTI 2015":
        for label, score in KITTI_OTHERS.items():
            cells = tuple(PaperCell(paper=score.value(column.measure)) for column in layout.columns)
            rows.append(PaperRow("", f"{label} (paper)", cells))
    return PaperTable(layout.number, layout.title, layout.columns, tuple(rows), beside)


def _cell(
    each: EvaluatedSet,
    known: Bootstrap,
    printed: Mapping[str, PaperScore],
    method: str,
    column: MeasureColumn,
) -> PaperCell:
    scores, measure = each.evaluation.scores, column.measure
    value = scores[method].measures()[measure]
    base = scores[REFERENCE].measures()[measure] if REFERENCE in scores else NAN
    paper = printed.get(SAME_IN_PAPER.get(method, method), PaperScore()).value(measure)
    paper_base = printed.get(REFERENCE, PaperScore()).value(measure)
    return PaperCell(
        value=value,
        interval=known.values[method].get(measure, UNKNOWN),
        ratio=_ratio(value, base) if column.compared else NAN,
        ratio_interval=known.ratios.get(method, {}).get(measure, UNKNOWN),
        paper=paper,
        paper_ratio=_ratio(paper, paper_base) if column.compared else NAN,
    )


def _ratio(value: float, base: float) -> float:
    return value / base if base else NAN

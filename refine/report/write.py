"""The report of evaluations: one self-contained HTML file, and the same numbers and figures as files."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from markupsafe import Markup

from refine.evaluation.bootstrap import LEVEL, Bootstrap, bootstrap
from refine.evaluation.evaluate import Evaluation
from refine.evaluation.results import EvaluatedSet, mean_curves, results_csv, results_json
from refine.report.figures import (
    PanelView,
    auc_figure,
    close_up_picture,
    curve_figure,
    panel_picture,
    panel_view,
)
from refine.report.paper_tables import PaperTable, paper_tables
from refine.report.table_files import (
    caption,
    printed,
    printed_interval,
    printed_paper,
    printed_ratio,
    tables_csv,
    tables_json,
    tables_latex,
    tables_markdown,
)
from refine.report.tables import (
    Table,
    Tile,
    confidence_table,
    error_table,
    frame_table,
    missing_notes,
    overview_table,
    refined_confidence_table,
    summary_tiles,
)
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import write_bytes, write_text
from stereoforge_kit.viewing import render_page
from stereoforge_kit.viewing.html import encoded
from stereoforge_kit.viewing.plots import hoverable, svg_file


@dataclass(frozen=True)
class ReportContext:
    """What the numbers cannot say by themselves."""

    title: str = "Disparity refinement, evaluated"
    lead: str = ""
    """One or two sentences under the title."""
    facts: Mapping[str, str] = field(default_factory=dict)
    """Where it all comes from, for example {"Weights": "...", "Command": "..."}."""
    limits: tuple[str, ...] = ()
    """Honest sentences a reader must know before believing a number: budget, sizes, what is missing."""
    bootstrap_seed: int = 0
    compact: bool = False
    """For results that are kept under version control: without each frame's numbers (results.csv and .json) and
    without the panels as files of their own (Figs 6 and 8), which the page shows all the same."""
    sections: str = ""
    """Further parts of the page as HTML, put between the summary and the sets; the first has the id "gap"."""


@dataclass(frozen=True)
class ReportFiles:
    """Where `write_report` wrote."""

    html: Path
    csv: Path
    json: Path
    """These two are not there in a compact report."""
    figures: Path
    """Folder of the figures, a folder a set: `fig1-N.png`, `fig4.svg`, `fig4-mean.svg`, `fig5.svg`, `fig6-N.png`;
    in KITTI's style 7 and 8 for 5 and 6."""


@dataclass(frozen=True)
class SetView:
    """One data set's part of the page."""

    id: str
    name: str
    evaluation: Evaluation
    facts: Mapping[str, str]
    intervals: Bootstrap
    tiles: list[Tile]
    tables: tuple[PaperTable, ...]
    errors: Table
    missing: list[str]
    confidences: Table | None
    """None, and no plots, where no confidence was predicted."""
    refined_confidences: Table | None
    frames: Table
    curve_plots: tuple[Markup, ...]
    auc_plot: Markup | None
    panels: list[PanelView]
    worst: list[PanelView]
    worst_shown_above: list[str]
    kitti: bool


def write_report(
    sets: Sequence[EvaluatedSet],
    out: Path,
    context: ReportContext = ReportContext(),
) -> ReportFiles:
    """Write the report of one or more sets into the folder `out`, made if missing.

    `report.html`; every number in `results.csv` and `results.json`; the paper's tables in `tables.csv`, `.json`,
    `.md` and `.tex`; the figures in `figures/`. Each file is replaced in one step: a reader never meets half of
    one.

    Raises:
        ValueError: If there is no set, or two share a name.
    """
    if not sets or len({each.name for each in sets}) != len(sets):
        raise InputError("a report needs at least one set, and no two of one name")
    files = ReportFiles(out / "report.html", out / "results.csv", out / "results.json", out / "figures")
    about = {"title": context.title, **context.facts, "limits": list(context.limits)}
    views = [_set_view(each, index, context.bootstrap_seed) for index, each in enumerate(sets)]
    tables = {view.name: view.tables for view in views}
    if not context.compact:
        write_text(files.csv, results_csv(sets))
        write_text(files.json, results_json(sets, about))
    write_text(out / "tables.csv", tables_csv(tables))
    write_text(out / "tables.json", tables_json(tables))
    write_text(out / "tables.md", tables_markdown(tables))
    write_text(out / "tables.tex", tables_latex(tables))
    for view in views:
        for name, content in _figure_files(view, context.compact):
            write_bytes(files.figures / folder_name(view.name) / name, content)
    write_text(files.html, _page(sets, views, context))
    return files


def folder_name(name: str) -> str:
    """A set's name as a file system takes it."""
    return re.sub(r"[^\w.-]+", "-", name).strip("-.") or "set"


def _page(sets: Sequence[EvaluatedSet], views: list[SetView], context: ReportContext) -> str:
    return render_page(
        "refine.report",
        "report.html",
        title=context.title,
        context=context,
        views=views,
        overview=overview_table(sets, [view.intervals for view in views]) if len(views) > 1 else None,
        level=f"{LEVEL:.0%}".replace("%", " %"),
        caption=caption,
        printed=printed,
        printed_interval=printed_interval,
        printed_paper=printed_paper,
        printed_ratio=printed_ratio,
    )


def _set_view(each: EvaluatedSet, index: int, seed: int) -> SetView:
    evaluation = each.evaluation
    intervals = bootstrap(evaluation, seed=seed)
    shown = {panel.order for panel in evaluation.first}
    return SetView(
        id=f"set-{index + 1}",
        name=each.name,
        evaluation=evaluation,
        facts=each.facts,
        intervals=intervals,
        tiles=summary_tiles(evaluation),
        tables=paper_tables(each, intervals),
        errors=error_table(evaluation),
        missing=missing_notes(evaluation),
        confidences=confidence_table(evaluation) if evaluation.measured_confidences else None,
        refined_confidences=refined_confidence_table(evaluation),
        frames=frame_table(evaluation),
        curve_plots=tuple(hoverable(figure) for _, figure in _curve_figures(evaluation)),
        auc_plot=hoverable(auc_figure(evaluation.frames)) if _has_auc_figure(evaluation) else None,
        panels=[panel_view(evaluation, panel) for panel in evaluation.first],
        worst=[
            panel_view(evaluation, panel, failure=True)
            for panel in evaluation.worst
            if panel.order not in shown
        ],
        worst_shown_above=[panel.frame.name for panel in evaluation.worst if panel.order in shown],
        kitti=each.is_kitti,
    )


def _has_auc_figure(evaluation: Evaluation) -> bool:
    return len(evaluation.frames) > 1 and bool(evaluation.measured_confidences)


def _curve_figures(evaluation: Evaluation) -> Iterator[tuple[str, Any]]:
    """The sparsification curves of the first frame with ground truth and of all; none without a confidence."""
    if not evaluation.measured_confidences:
        return
    first = next((frame for frame in evaluation.frames if frame.has_truth), evaluation.frames[0])
    yield "fig4.svg", curve_figure(first.curves, first.initial_bad, f"First frame, {first.name}")
    count = sum(frame.has_truth for frame in evaluation.frames)
    yield "fig4-mean.svg", curve_figure(mean_curves(evaluation), None, f"Mean of {count} frames")


def _figure_files(view: SetView, compact: bool) -> Iterator[tuple[str, bytes]]:
    """Each figure of a set: its file's name and content."""
    for name, figure in _curve_figures(view.evaluation):
        yield name, svg_file(figure).encode()
    if view.auc_plot is not None:
        yield "fig7.svg" if view.kitti else "fig5.svg", svg_file(auc_figure(view.evaluation.frames)).encode()
    panels = "fig8" if view.kitti else "fig6"
    for number, panel in enumerate((*view.panels, *view.worst), start=1):
        if not compact:
            yield f"{panels}-{number}.png", encoded(panel_picture(panel))
        if panel.close_up is not None:
            yield f"fig1-{number}.png", encoded(close_up_picture(panel.close_up))

"""The report of an evaluation: one self-contained HTML file, and the same numbers as CSV and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from refine.evaluation import Evaluation
from refine.report_figures import auc_figure, curve_figure, panel_view
from refine.report_tables import (
    confidence_table,
    error_table,
    frame_table,
    missing_notes,
    ratio_tables,
    summary_tiles,
)
from refine.results import mean_curves, results_csv, results_json
from storage import write_text
from viewing import render_page
from viewing.plots import svg


@dataclass(frozen=True)
class ReportContext:
    """What the numbers cannot say by themselves."""

    title: str = "Disparity refinement, evaluated"
    lead: str = ""
    """One or two sentences under the title."""
    facts: Mapping[str, str] = field(default_factory=dict)
    """Where it all comes from, for example {"Test data": "...", "Weights": "...", "Command": "..."}."""
    limits: tuple[str, ...] = ()
    """Honest sentences a reader must know before believing a number: budget, sizes, what is missing."""


@dataclass(frozen=True)
class ReportFiles:
    """Where `write_report` wrote."""

    html: Path
    csv: Path
    json: Path


def write_report(
    evaluation: Evaluation,
    out: Path,
    context: ReportContext = ReportContext(),
) -> ReportFiles:
    """Write `report.html`, `results.csv` and `results.json` into the folder `out`, made if missing.

    Each file is replaced in one step: a reader never meets half of one.
    """
    files = ReportFiles(out / "report.html", out / "results.csv", out / "results.json")
    about = {"title": context.title, **context.facts, "limits": list(context.limits)}
    write_text(files.csv, results_csv(evaluation))
    write_text(files.json, results_json(evaluation, about))
    write_text(files.html, report_html(evaluation, context))
    return files


def report_html(evaluation: Evaluation, context: ReportContext) -> str:
    """The page as text."""
    first = evaluation.frames[0]
    shown = {panel.order for panel in evaluation.first}
    return render_page(
        "refine",
        "report.html",
        title=context.title,
        context=context,
        evaluation=evaluation,
        threshold=f"{evaluation.options.bad_threshold:g}",
        tiles=summary_tiles(evaluation),
        errors=error_table(evaluation),
        missing=missing_notes(evaluation),
        ratios=ratio_tables(evaluation),
        confidences=confidence_table(evaluation),
        frame_rows=frame_table(evaluation),
        first_curves=svg(curve_figure(first.curves, first.initial_bad, f"First frame, {first.name}")),
        mean_curves=svg(
            curve_figure(mean_curves(evaluation), None, f"Mean of {len(evaluation.frames)} frames")
        ),
        auc_plot=svg(auc_figure(evaluation.frames)) if len(evaluation.frames) > 1 else "",
        panels=[panel_view(evaluation, panel) for panel in evaluation.first],
        worst=[
            panel_view(evaluation, panel, failure=True)
            for panel in evaluation.worst
            if panel.order not in shown
        ],
        worst_shown_above=[panel.frame.name for panel in evaluation.worst if panel.order in shown],
    )

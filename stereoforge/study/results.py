"""A study's results: the numbers as files, and one report that begins with the gap."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from matplotlib.figure import Figure

from refine.evaluation.results import EvaluatedSet
from refine.report.tables import Cell, Table, number
from stereoforge.pipelines.prediction import open_settings
from stereoforge.pipelines.set_evaluation import describe_settings, report_evaluation
from stereoforge.study.gap import MEASURES, Gap, error_of, gaps, gaps_document, summary
from stereoforge.study.plan import StudyPlan
from stereoforge.study.statistics import BIN_PX, QUANTILES, DomainStatistics
from stereoforge_kit.files import write_text
from stereoforge_kit.viewing.html import environment
from stereoforge_kit.viewing.plots import curves, hoverable, svg_file

Cells = Mapping[tuple[str, str], EvaluatedSet]


@dataclass(frozen=True)
class StudyResult:
    """Where the results are, and the main ones."""

    folder: Path
    report: Path
    cells: Cells
    """By (trained on, tested on)."""
    gaps: list[Gap]


def write_results(
    plan: StudyPlan,
    out: Path,
    *,
    cells: Cells,
    fine_tuned: Mapping[str, EvaluatedSet],
    statistics: Mapping[str, DomainStatistics],
    weights: Path,
) -> StudyResult:
    """Write report.html and its files, gap.json, matrix.csv, summary.json and the plan.

    Args:
        fine_tuned: Test domain to the subject's regressor fine-tuned on it.
        weights: Run folder of the subject.
    """
    subject = plan.subject
    found = gaps(subject, plan.test, cells, fine_tuned)
    sets = [cells[subject, test] for test in plan.test]
    distribution = _distribution(statistics)
    sections = (
        environment("stereoforge.study")
        .get_template("study.html")
        .render(
            plan=plan,
            matrices=[(heading, _matrix(plan, cells, measure)) for measure, heading in MEASURES.items()],
            gap_table=_gap_table(found),
            statistics=_statistics_table(statistics),
            distribution=hoverable(distribution),
            budgets=_budgets(plan),
        )
    )
    files = report_evaluation(
        sets,
        weights,
        out,
        title=f"Trained on {subject}, tested on {', '.join(plan.test)}",
        facts={
            "Parameters": describe_settings(open_settings(None, weights)),
            "Command": "stereoforge study --plan plan.yaml --out DIR, with the plan.yaml beside this page",
        },
        bootstrap_seed=plan.seed,
        sections=sections,
        compact=True,
    )
    write_text(out / "figures" / "disparities.svg", svg_file(distribution))
    write_text(out / "summary.json", _json(summary(subject, plan.test, cells)))
    write_text(out / "gap.json", _json(gaps_document(found)))
    write_text(out / "matrix.csv", _matrix_csv(cells))
    write_text(out / "plan.yaml", yaml.safe_dump(plan.plain(), sort_keys=False))
    return StudyResult(out, files.html, cells, found)


def _json(document: object) -> str:
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def _matrix(plan: StudyPlan, cells: Cells, measure: str) -> Table:
    """Rows: trained on; columns: tested on, the regressor's error and that after refinement."""
    scale, digits = (100, 1) if measure.startswith("bad") else (1, 3 if "gradient" in measure else 2)
    rows = []
    for name in plan.train:
        row = []
        for test in plan.test:
            before, after = (error_of(cells[name, test], method, measure) for method in ("regressor", "ours"))
            texts = (number(before, digits, scale).text, number(after, digits, scale).text)
            row.append(Cell(" → ".join(texts), repr(before), best=name == test))
        rows.append((name, tuple(row)))
    return Table(("Trained on", *(f"on {test}" for test in plan.test)), tuple(rows))


def _gap_table(found: list[Gap]) -> Table | None:
    """Only where a gap is known."""
    known = [gap for gap in found if gap.size == gap.size]
    if not known:
        return None
    rows = []
    for gap in known:
        scale = 100 if gap.measure.startswith("bad") else 1
        cells = (
            number(gap.cross, 2, scale),
            number(gap.home, 2, scale),
            number(gap.size, 2, scale),
            *(number(share, 0, 100) for share in gap.shares.values()),
        )
        rows.append((f"{gap.domain}: {MEASURES[gap.measure]}", cells))
    headings = (
        "Tested on",
        "trained elsewhere",
        "trained there",
        "gap",
        *(f"{name}, %" for name in known[0].shares),
    )
    return Table(headings, tuple(rows))


def _statistics_table(statistics: Mapping[str, DomainStatistics]) -> Table:
    shares = ("discontinuities", "occluded", "out_of_frame", "textured")
    rows = tuple(
        (
            name,
            (
                number(each.frames, 0),
                *(number(value, 1) for value in each.quantiles),
                number(each.slope, 3),
                *(number(getattr(each, share), 1, 100) for share in shares),
            ),
        )
        for name, each in statistics.items()
    )
    quantiles = (f"{share:.0%}".replace("%", " %") for share in QUANTILES)
    words = ("at a jump, %", "occluded, %", "out of frame, %", "textured, %")
    return Table(("Domain", "frames", *quantiles, "mean slope", *words), rows)


def _distribution(statistics: Mapping[str, DomainStatistics]) -> Figure:
    series = {
        name: (np.arange(len(each.histogram)) * BIN_PX + BIN_PX / 2, np.array(each.histogram) * 100 / BIN_PX)
        for name, each in statistics.items()
    }
    return curves(series, "disparity, px", "% of pixels a px", "Disparities of the test sets")


def _budgets(plan: StudyPlan) -> list[str]:
    """How much each domain's networks had."""
    sentences = []
    for name in plan.train:
        domain = plan.domains[name]
        if domain.source is None:
            frames = plan.recipe(name, ("train",)).world.frames
            data = f"{domain.scenes.get('train', 0) * frames} pairs"
        else:
            data = domain.source
        steps = ", ".join(f"{task} {count}" for task, count in domain.steps.items()) or "the preset's"
        sentences.append(f"{name}: {data}, preset {plan.preset}, steps {steps}")
    return sentences


def _matrix_csv(cells: Cells) -> str:
    lines = ["trained_on,tested_on,method,measure,value"]
    for (name, test), evaluated in cells.items():
        for method in evaluated.evaluation.scores:
            for measure in MEASURES:
                value = error_of(evaluated, method, measure)
                lines.append(f"{name},{test},{method},{measure},{'' if value != value else repr(value)}")
    return "\n".join(lines) + "\n"

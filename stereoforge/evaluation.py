"""Joining data sets, networks and the MRF into an evaluation and its report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from datagen.frame import StereoFrame
from refine.evaluation import Evaluation, evaluate
from refine.methods import Method
from refine.report import ReportContext, ReportFiles, write_report
from stereoforge.prediction import Predictors
from stereoforge.progress import progress_bar


def evaluate_datasets(
    datasets: Sequence[Sequence[StereoFrame]], predictors: Predictors, methods: tuple[Method, ...] = ()
) -> Evaluation:
    """Run the networks and every method on every frame, showing progress."""
    with progress_bar() as progress:
        task = progress.add_task("evaluating", total=sum(map(len, datasets)))
        return evaluate(
            (predictors.frame(sample) for dataset in datasets for sample in dataset),
            methods,
            progress=lambda done, _: progress.update(task, completed=done),
        )


def report_evaluation(
    evaluation: Evaluation,
    sources: Sequence[str],
    weights: Path,
    out: Path,
    limits: tuple[str, ...] = (),
    title: str = "StereoForge evaluation",
) -> ReportFiles:
    """Write the report, saying what was evaluated with what.

    sources: the data sets' names, with their splits.
    """
    return write_report(
        evaluation,
        out,
        ReportContext(
            title=title,
            facts={
                "Data": ", ".join(sources),
                "Frames": str(len(evaluation.frames)),
                "Weights": "; ".join(_describe_networks(weights)),
            },
            limits=limits,
        ),
    )


def _describe_networks(weights: Path) -> Iterator[str]:
    from training.presets import TASKS
    from training.weights import has_weights, read_summary

    for task in TASKS:
        if has_weights(weights, task):
            summary = read_summary(weights, task)
            yield f"{task} ({summary.preset}, step {summary.best_step} of {summary.steps})"

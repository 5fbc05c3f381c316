"""`stereoforge evaluate`: how good are the networks and the refinement on data with ground truth?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from stereoforge.progress import console
from stereoforge.values import parse_methods, shown


@dataclass(frozen=True)
class Evaluate:
    """Evaluate on data sets and write report.html, results.csv and results.json."""

    data: Annotated[tyro.conf.Positional[tuple[str, ...]], shown("DATA")]
    """Data sets: folders or URLs, with FORMAT: in front where the folder does not tell, #0-99 behind for a part."""
    weights: Annotated[Path, shown("RUN")]
    """Run folder of the networks."""
    out: Annotated[Path, shown("REPORT")]
    """Folder for the report."""
    split: Literal["train", "val", "test"] = "test"
    """Which split of the data sets; those without splits are taken whole."""
    methods: Annotated[str, shown("LIST", "all there are")] = ""
    """Rows of the tables, comma-separated."""
    predictor: Literal["networks", "sgbm"] = "networks"
    """What gives the disparity that is refined: the run folder's networks, or semi-global matching, judged by its
    confnet_free and gradnet_free."""
    parameters: Annotated[Path | None, shown("FILE", "the run folder's, if it has one")] = None
    """The methods' parameters, as `stereoforge tune` writes them."""
    device: Annotated[str, shown("NAME")] = "cpu"
    """What the networks run on: cpu, cuda, ..."""

    def run(self) -> None:
        from datagen.source import open_source
        from stereoforge.errors import UsageError
        from stereoforge.evaluation import evaluate_datasets, report_evaluation
        from stereoforge.prediction import fallback_notes, open_predictors, open_settings

        methods = parse_methods(self.methods)
        if not self.data:
            raise UsageError("evaluate needs at least one data set")
        datasets = [open_source(source).frames(self.split) for source in self.data]
        predictors = open_predictors(self.weights, self.device, self.predictor)
        settings = open_settings(self.parameters, self.weights, self.predictor)
        evaluation = evaluate_datasets(datasets, predictors, settings.rows(methods))
        names = [f"{source} ({self.split})" for source in self.data]
        files = report_evaluation(evaluation, names, self.weights, self.out)
        for note in fallback_notes(self.weights) if self.predictor == "sgbm" else []:
            console.print(note, markup=False)
        for name, reason in evaluation.skipped.items():
            console.print(f"{name} did not run: {reason}", markup=False)
        console.print(f"{files.html}: {len(evaluation.frames)} frames")

"""`stereoforge evaluate`: how good are the networks and the refinement on data with ground truth?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from stereoforge.progress import console
from stereoforge.values import shown


@dataclass(frozen=True)
class Evaluate:
    """Evaluate on data sets and write report.html, results.csv and results.json."""

    data: Annotated[tyro.conf.Positional[tuple[Path, ...]], shown("DATA")]
    """Data sets."""
    weights: Annotated[Path, shown("RUN")]
    """Run folder of the networks."""
    out: Annotated[Path, shown("REPORT")]
    """Folder for the report."""
    split: Literal["train", "val", "test"] = "test"
    """Which split of the data sets."""
    methods: Annotated[str, shown("LIST", "all there are")] = ""
    """Rows of the tables, comma-separated."""
    device: Annotated[str, shown("NAME")] = "cpu"
    """What the networks run on: cpu, cuda, ..."""

    def run(self) -> None:
        from datagen import StereoDataset
        from refine.methods import default_methods
        from stereoforge.errors import UsageError
        from stereoforge.evaluation import evaluate_datasets, report_evaluation
        from stereoforge.prediction import open_predictors

        methods = tuple(name.strip() for name in self.methods.split(",") if name.strip())
        try:
            default_methods(methods)
        except ValueError as error:
            raise UsageError(f"--methods: {error}") from error
        if not self.data:
            raise UsageError("evaluate needs at least one data set")
        datasets = [StereoDataset(root, self.split) for root in self.data]
        evaluation = evaluate_datasets(datasets, open_predictors(self.weights, self.device), methods)
        files = report_evaluation(evaluation, datasets, self.weights, self.out)
        for name, reason in evaluation.skipped.items():
            console.print(f"{name} did not run: {reason}", markup=False)
        console.print(f"{files.html}: {len(evaluation.frames)} frames")

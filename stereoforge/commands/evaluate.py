"""`stereoforge evaluate`: how good are the networks and the refinement on data with ground truth?"""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from stereoforge.bundled_weights import BUNDLED_WEIGHTS, named_weights
from stereoforge.errors import CommandError, UsageError
from stereoforge.inputs.flag_values import check_max_disparity, parse_methods, several, shown
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, remark


@dataclass(frozen=True)
class Evaluate:
    """Evaluate on data sets: the paper's tables and figures, one block a set, its numbers beside ours.

    Writes report.html, every number as results.csv and results.json, the paper's tables as tables.csv, .json, .md
    and .tex, and figures/.
    """

    data: Annotated[tyro.conf.Positional[tuple[str, ...]], several("DATA")]
    """Data sets: folders or URLs, with FORMAT: in front where the folder does not tell, #0-99 behind for a part."""
    out: Annotated[Path, shown("REPORT")]
    """Folder for the report."""
    weights: Annotated[Path, shown("RUN", "the bundled weights")] = BUNDLED_WEIGHTS
    """Run folder of the networks. paper: the bundled networks of the paper."""
    split: Literal["train", "val", "test"] = "test"
    """Which split of the data sets; those without splits are taken whole."""
    methods: Annotated[str, shown("LIST", "all there are")] = ""
    """Rows of the tables, comma-separated."""
    predictor: Literal["networks", "sgbm"] = "networks"
    """What gives the disparity that is refined: the run folder's networks, or semi-global matching, judged by its
    confnet_free and gradnet_free."""
    max_disparity: Annotated[int | None, shown("PX", "chosen for the pictures")] = None
    """Largest disparity in pixels to look for. DispNetCorr1D looks as far as it was trained to."""
    parameters: Annotated[Path | None, shown("FILE", "the run folder's, if it has one")] = None
    """The methods' parameters, as `stereoforge tune` writes them."""
    bad_threshold: Annotated[float | None, shown("PX", "1, for KITTI 3")] = None
    """A disparity further off than this is bad, in pixels."""
    protocol: Annotated[Literal["pooled", "generalization"], shown("pooled|generalization")] = "pooled"
    """pooled: every pixel of a set counts alike. generalization: also the field's table of networks on sets that they
    were not trained on, generalization.csv: mean error, and outliers in occluded, visible and all pixels, over 3 px
    (KITTI and others), 2 px (Middlebury) or 1 px (ETH3D), each the mean of the frames' own, with ground truth from 0
    to 191 px."""
    seed: Annotated[int, shown("N")] = 0
    """Of the confidence intervals, which draw scenes with replacement."""
    posterior: Annotated[int, shown("N")] = 0
    """Sample each frame's posterior N times (32 is enough), and report how well its standard deviations tell wrong
    refined disparities from right ones; 0 leaves it out. Each sample takes as long as a refinement."""
    submission: Annotated[Path | None, shown("DIR", "none")] = None
    """Also write the refined disparities of a KITTI set as its server takes them, DIR/disp_0/NNNNNN_10.png for 2015 and
    DIR/NNNNNN_10.png for 2012: those of its testing part, or of the training part where only that is there or named."""
    skip_broken: bool = False
    """Leave out the frames whose files are missing or damaged, and say which; else nothing is evaluated."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What the networks run on: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""

    def run(self) -> None:
        """Predict, refine and score every frame, then write the report."""
        methods = parse_methods(self.methods)
        run = named_weights(self.weights)
        if not self.data:
            raise UsageError("evaluate needs at least one data set")
        if self.protocol == "generalization" and self.bad_threshold is not None:
            raise UsageError("--protocol generalization has thresholds of its own; leave out --bad-threshold")
        if self.bad_threshold is not None and not self.bad_threshold > 0:
            raise UsageError(f"--bad-threshold must be positive, got {self.bad_threshold}")
        check_max_disparity(self.max_disparity)
        if self.seed < 0:
            raise UsageError(f"--seed must not be negative, got {self.seed}")
        if self.posterior < 0:
            raise UsageError(f"--posterior must not be negative, got {self.posterior}")
        for source in self.data:
            keep_apart("--out", self.out, "the data set", source)
            if self.submission is not None:
                keep_apart("--submission", self.submission, "the data set", source)
        check_writable("--out", self.out)
        if self.submission is not None:
            check_writable("--submission", self.submission)
        from stereoforge.pipelines.generalization import (
            counted_truth,
            generalization_rows,
            outlier_px,
            write_generalization,
        )
        from stereoforge.pipelines.prediction import (
            fallback_notes,
            open_predictors,
            open_settings,
            untrained,
            untrained_notes,
        )
        from stereoforge.pipelines.set_evaluation import (
            describe_settings,
            evaluate_set,
            evaluation_options,
            open_test_data,
            report_evaluation,
        )
        from stereoforge.pipelines.submission import find_submission, write_submission
        from training.devices import parse_device

        by_field = self.protocol == "generalization"
        parse_device(self.device)
        data = open_test_data(self.data, self.split, skip_broken=self.skip_broken)
        submission = find_submission(self.data) if self.submission else None
        settings = open_settings(self.parameters, run, self.predictor)
        predictors = open_predictors(run, self.device, self.predictor, self.max_disparity)
        rows = settings.rows(methods)
        lacking = untrained(rows, run, self.predictor)
        notes = untrained_notes(lacking, run, self.predictor)
        if len(lacking) == len(rows):
            for note in notes[:-1]:
                remark(note)
            raise CommandError(notes[-1])
        sets = [
            evaluate_set(
                each,
                predictors,
                rows,
                evaluation_options(
                    each.family, outlier_px(each.family) if by_field else self.bad_threshold, self.posterior
                ),
                skip_broken=self.skip_broken,
                prepare=counted_truth if by_field else None,
            )
            for each in data
        ]
        facts = {
            "Parameters": describe_settings(settings),
            "Command": shlex.join(["stereoforge", *sys.argv[1:]]),
        }
        files = report_evaluation(sets, run, self.out, facts=facts, bootstrap_seed=self.seed)
        if self.predictor == "sgbm":
            notes += fallback_notes(run)
        skipped = sets[0].evaluation.skipped
        for note in (*notes, *(reason for name, reason in skipped.items() if name not in lacking)):
            remark(note)
        frames = ", ".join(f"{len(each.evaluation.frames)} of {each.name}" for each in sets)
        console.print(f"{files.html}: frames evaluated: {frames}")
        if by_field:
            figures = [row for each in sets for row in generalization_rows(each)]
            for row in figures:
                console.print(
                    f"{row.set}, {row.method}: {row.epe:.2f} px; outliers over {row.outlier_px:g} px: occluded "
                    f"{row.occluded:.1f} %, visible {row.visible:.1f} %, all {row.all:.1f} %",
                    markup=False,
                )
            console.print(str(write_generalization(figures, self.out)), markup=False)
        if self.submission and submission:
            count = write_submission(submission, predictors, settings.ours, self.submission)
            console.print(f"{self.submission}: {count} disparities")
            if submission.note:
                remark(submission.note)

"""`stereoforge tune`: choose every method's parameters on the validation split."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from stereoforge.bundled_weights import BUNDLED_WEIGHTS, named_weights
from stereoforge.errors import CommandError, UsageError
from stereoforge.inputs.flag_values import parse_methods, several, shown
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, remark
from stereoforge_kit.files import is_within
from stereoforge_kit.messages import listed


@dataclass(frozen=True)
class Tune:
    """Choose the parameters of the refinement and of every baseline on the validation split, and only there.

    A coordinate search: each parameter in turn moves along a short list of values while the errors, relative to the
    initial disparity's, fall. Run it again to continue where it stopped.
    """

    interrupted: ClassVar[str] = "the same command run again continues where it stopped"

    data: Annotated[tyro.conf.Positional[tuple[str, ...]], several("DATA")]
    """Data sets, as for `evaluate`; their validation splits are used. One without splits needs #0-99 behind."""
    weights: Annotated[Path, shown("RUN")]
    """Run folder of the networks. paper: the bundled networks of the paper, with --out."""
    out: Annotated[Path | None, shown("FILE", "parameters.json in the run folder")] = None
    """File for the parameters. One in the run folder is used by evaluate and refine without being named; those for
    --predictor sgbm are in parameters_sgbm.json there."""
    methods: Annotated[str, shown("LIST", "all there are")] = ""
    """Methods to tune, comma-separated."""
    predictor: Literal["networks", "sgbm"] = "networks"
    """What gives the disparity that is refined: the run folder's networks, or semi-global matching."""
    frames: Annotated[int, shown("N")] = 20
    """Validation frames looked at, evenly spread; all are kept in memory."""
    objective: Literal["balanced", "bad", "epe", "gradient"] = "balanced"
    """What shall be small: bad pixels, end-point error, gradient error, or the mean of the three."""
    device: Annotated[str, shown("NAME")] = "auto"
    """What the networks run on: auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps."""

    def run(self) -> None:
        """Search the parameters and write them into the run folder."""
        if self.frames < 1:
            raise UsageError(f"--frames must be at least 1, got {self.frames}")
        if not self.data:
            raise UsageError("tune needs at least one data set")
        run = named_weights(self.weights)
        if self.out is None and is_within(run, BUNDLED_WEIGHTS):
            raise UsageError(
                "the bundled weights stay as they are: name a file for the parameters with --out"
            )
        if self.out is not None:
            for source in self.data:
                keep_apart("--out", self.out, "the data set", source)
            check_writable("--out", self.out.parent)
        methods = parse_methods(self.methods)
        from rich.table import Table

        from datagen.sources.registry import open_source
        from refine.registry import default_methods
        from stereoforge.pipelines.parameter_search import Tuning, describe, shown_values, validation_frames
        from stereoforge.pipelines.prediction import (
            network_digests,
            open_predictors,
            parameters_file,
            untrained,
            untrained_notes,
        )
        from training.devices import parse_device

        parse_device(self.device)
        sources = [open_source(text) for text in self.data]
        predictors = open_predictors(run, self.device, self.predictor)
        asked = [method for method in default_methods(methods) if method.search]
        lacking = untrained(asked, run, self.predictor)
        notes = untrained_notes(lacking, run, self.predictor)
        if len(lacking) == len(asked):
            for note in notes[:-1]:
                remark(note)
            raise CommandError(notes[-1] if notes else f"{listed(methods)}: there is nothing to tune")
        for opened in sources:
            if opened.note:
                remark(f"{opened.location}: {opened.note}")
        frames = validation_frames(sources, predictors, self.frames)
        out = parameters_file(run, self.predictor) if self.out is None else self.out
        about = describe(frames, self.data, self.objective, network_digests(run, self.predictor))
        tuned = Tuning(frames, out, about, self.objective).run(methods)
        table = Table(
            "method", "default", "tuned", "parameters", title=f"{self.objective}, relative to the input"
        )
        for name, result in tuned.items():
            if result.trials:
                values = (f"{value:.3f}" for value in (result.default_objective, result.objective))
                table.add_row(name, *values, shown_values(result.method))
        console.print(table)
        for note in notes:
            remark(note)
        console.print(f"{out}: {len(tuned)} methods, validated on {len(frames)} frames")

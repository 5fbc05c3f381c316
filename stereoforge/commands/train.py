"""`stereoforge train`: one network, from data sets to weights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from stereoforge.errors import UsageError
from stereoforge.inputs.flag_values import (
    check_disparity_scale,
    parse_size,
    parse_weighted_source,
    several,
    shown,
)
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console
from stereoforge_kit.files import write_bytes


@dataclass(frozen=True)
class Train:
    """Train a network on the train splits of data sets; their val splits decide which weights are kept.

    The run folder collects the networks: train the regressor first, then confnet and gradnet into the same
    folder (or name the regressor's with --init).
    """

    task: Annotated[
        tyro.conf.Positional[
            Literal[
                "regressor",
                "regressor_f",
                "confnet",
                "gradnet",
                "confnet_free",
                "gradnet_free",
                "joint",
                "rdf",
            ]
        ],
        shown("TASK"),
    ]
    """regressor: the network that predicts disparity. regressor_f: a regressor fine-tuned on gradients too. confnet,
    gradnet: the heads on a regressor. confnet_free, gradnet_free: regressor-free heads, for the disparity of any
    predictor, trained on semi-global matching and, with --init, on that regressor's disparity. rdf: a random forest,
    the rival of ConfNet. joint: trains confnet and gradnet of --init further, through the refinement, into another run
    folder."""
    data: Annotated[tuple[str, ...], several("DATA[:WEIGHT]")]
    """Data sets, each with how often it is drawn from relative to the others (default 1): folders or URLs, with
    FORMAT: in front where the folder does not tell, #0-99 behind for a part."""
    out: Annotated[Path, shown("RUN")]
    """Run folder."""
    preset: Literal["tiny", "small", "full"] = "small"
    """tiny: minutes on a laptop; small: hours; full: the paper's own training."""
    network: Annotated[str | None, shown("NAME", "costvolume")] = None
    """regressor: costvolume is CostVolumeNet, which matches and so does well on photographs too; dispnet is
    DispNetCorr1D, the paper's."""
    validation: Annotated[tuple[str, ...], shown("DATA", "the val splits of --data")] = ()
    """Data sets that decide which weights are kept."""
    crop: Annotated[str | None, shown("WxH", "the preset's")] = None
    """Size of the training crops, multiples of 64 (for costvolume, of 32); KITTI's frames need 320 rows or fewer."""
    batch_size: Annotated[int | None, shown("N", "the preset's")] = None
    """Crops in an optimizer step."""
    learning_rate: Annotated[float | None, shown("RATE", "the preset's")] = None
    """The largest learning rate, after the warm-up."""
    freeze: Annotated[str | None, shown("PARTS", "none")] = None
    """regressor with --init, regressor_f: parts of the network that stay as they are, comma-separated; of costvolume
    these are descriptors, aggregation, half_weights, look and full_look."""
    correct_within: Annotated[float | None, shown("PX", "the preset's, 1")] = None
    """confnet: a disparity this close to the ground truth counts as correct (KITTI: 3)."""
    ema: Annotated[float | None, shown("DECAY", "none")] = None
    """Validate and keep a moving average of the weights, for example 0.999."""
    curriculum: Annotated[float, shown("SHARE")] = 0.0
    """Share of the run over which the crops come from a growing first part of every data set, for those rendered from
    simple to complex (render --curriculum)."""
    pseudo_labels: Annotated[Path | None, shown("DIR", "none")] = None
    """Folder of disparities to train on instead of the data set's ground truth: <frame name> with .pfm, .png, .npy,
    .npz, .tiff or .exr."""
    disparity_scale: Annotated[float | None, shown("S", "256 in 16-bit PNG, else 1")] = None
    """Pseudo labels: value / S is the disparity in pixels."""
    init: Annotated[Path | None, shown("RUN", "none")] = None
    """Run folder of the regressor to start from or to build on; for joint, of all three networks and, where they are
    validated, of the refinement's parameters, which are copied too."""
    resume: bool = False
    """Continue from the last checkpoint as if never interrupted; --steps may be larger than before."""
    steps: Annotated[int | None, shown("N", "the preset's")] = None
    """Optimizer steps; all schedules are scaled to them."""
    seed: Annotated[int, shown("N")] = 0
    """Everything random follows from it."""
    workers: Annotated[int, shown("N")] = 0
    """Processes that prepare crops; results do not depend on their number."""
    device: Annotated[str, shown("NAME")] = "auto"
    """auto (cuda where there is such a GPU, else cpu), cpu, cuda, cuda:1 or mps; torchrun starts one process a
    device."""
    precision: Literal["32", "bf16", "16"] = "32"
    """Bits of the convolutions; 16 and bf16 are mixed precision."""

    @property
    def interrupted(self) -> str:
        """How to go on after an interruption."""
        if self.task == "rdf":
            return "nothing was written; run the same command again"
        from training.errors import TrainingError
        from training.runs.checkpoints import checkpoint_step
        from training.runs.run_folder import checkpoint_path

        try:
            step = checkpoint_step(checkpoint_path(self.out, self.task))
        except TrainingError as error:
            return str(error)
        if step is None:
            return "there is no checkpoint yet: run again with --resume to start from step 0"
        return f"run again with --resume to go on from step {step}"

    def run(self) -> None:
        """Train the network, or continue with --resume."""
        for name, value, least in (
            ("steps", self.steps, 1),
            ("seed", self.seed, 0),
            ("workers", self.workers, 0),
            ("batch-size", self.batch_size, 1),
        ):
            if value is not None and value < least:
                raise UsageError(f"--{name} must be at least {least}, got {value}")
        if self.network is not None and self.task != "regressor":
            raise UsageError(f"--network is for regressor; {self.task} takes the regressor of its run folder")
        check_disparity_scale(self.disparity_scale, "--pseudo-labels", self.pseudo_labels)
        data = [parse_weighted_source(text) for text in self.data]
        for source, _ in data:
            keep_apart("--out", self.out, "--data", source)
        for validation in self.validation:
            keep_apart("--out", self.out, "--validation", validation)
        keep_apart("--out", self.out, "--pseudo-labels", self.pseudo_labels)
        if (
            self.task == "regressor"
        ):  # Others add to the run folder; this one would replace what it starts from.
            keep_apart("--out", self.out, "--init", self.init)
        check_writable("--out", self.out)
        if self.task == "rdf":
            self._train_forest([source for source, _ in data])
            return
        from stereoforge.pipelines.prediction import open_settings, parameters_file
        from training.presets import DEFAULT_NETWORK
        from training.runs.hardware import process_rank
        from training.runs.request import TrainingRequest
        from training.runs.run_folder import written_networks
        from training.runs.train import train

        through = open_settings(None, self.init) if self.task == "joint" and self.init else None
        request = TrainingRequest(
            task=self.task,
            data=tuple(data),
            out=self.out,
            preset=self.preset,
            network=self.network or DEFAULT_NETWORK,
            validation=self.validation,
            changes=self._changes(),
            pseudo_labels=self.pseudo_labels,
            disparity_scale=self.disparity_scale,
            init=self.init,
            refinement=through.ours_quadratic if through else None,
            resume=self.resume,
            steps=self.steps,
            seed=self.seed,
            workers=self.workers,
            device=self.device,
            precision=self.precision,
        )
        summary = train(request)
        if process_rank() > 0:
            return
        if self.task == "joint" and self.init is not None and parameters_file(self.init).exists():
            write_bytes(parameters_file(self.out), parameters_file(self.init).read_bytes())
        figures = ", ".join(f"{name} {value:.4g}" for name, value in summary.validation.items())
        console.print(
            f"{self.out / ' and '.join(written_networks(self.task))}: step {summary.best_step} of {summary.steps}"
            + (
                f"; validation {figures}"
                if figures
                else "; no validation split, so the last weights are kept"
            )
        )

    def _train_forest(self, data: list[str]) -> None:
        for name in (
            "steps",
            "init",
            "resume",
            "validation",
            "crop",
            "batch_size",
            "learning_rate",
            "freeze",
            "correct_within",
            "ema",
            "curriculum",
            "pseudo_labels",
        ):
            if getattr(self, name):
                name = name.replace("_", "-")
                raise UsageError(
                    f"--{name} is for networks; a forest is trained at once, on the regressor in --out"
                )
        from stereoforge.pipelines.forest import PLANS, train_forest
        from stereoforge.pipelines.prediction import forest_file
        from training.devices import parse_device

        parse_device(self.device)
        forest = train_forest(data, self.out, PLANS[self.preset], self.seed, self.device)
        console.print(
            f"{forest_file(self.out)}: {len(forest.roots)} trees of {len(forest.feature)} nodes in all",
        )

    def _changes(self) -> dict[str, Any]:
        """What the flags change about the preset."""
        changes: dict[str, Any] = {}
        if self.crop is not None:
            changes["crop_width"], changes["crop_height"] = parse_size(self.crop, "crop")
        if self.batch_size is not None:
            changes["batch_size"] = self.batch_size
        if self.learning_rate is not None:
            if not 0 < self.learning_rate < float("inf"):
                raise UsageError(f"--learning-rate must be positive, got {self.learning_rate}")
            changes["learning_rate"] = self.learning_rate
        if self.freeze is not None:
            if self.task not in ("regressor", "regressor_f"):
                raise UsageError(f"--freeze is for regressor and regressor_f, not for {self.task}")
            changes["frozen"] = tuple(name.strip() for name in self.freeze.split(","))
        if self.correct_within is not None:
            if not 0 < self.correct_within < float("inf"):
                raise UsageError(f"--correct-within must be positive, got {self.correct_within}")
            changes["correct_within_px"] = self.correct_within
        if self.ema is not None:
            if not 0 < self.ema < 1:
                raise UsageError(f"--ema must lie between 0 and 1, got {self.ema}")
            changes["ema_decay"] = self.ema
        if self.curriculum:
            if not 0 < self.curriculum <= 1:
                raise UsageError(f"--curriculum must be a share from 0 to 1, got {self.curriculum}")
            changes["curriculum"] = self.curriculum
        return changes

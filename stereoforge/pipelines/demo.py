"""The demo: render, train, refine and evaluate, everything small, from nothing to a report in minutes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from rich.table import Table

from datagen import Recipe
from datagen.gallery.page import write_gallery
from refine.evaluation.bootstrap import FEWEST_SCENES
from refine.evaluation.evaluate import Evaluation
from refine.evaluation.results import EvaluatedSet
from refine.evaluation.settings import Settings
from scenes.families.flying_things import FlyingThingsConfig
from stereoforge.bundled_weights import BUNDLED_WEIGHTS
from stereoforge.pipelines.prediction import open_predictors, open_settings
from stereoforge.pipelines.rendering import render_all
from stereoforge.pipelines.set_evaluation import (
    TestData,
    describe_networks,
    describe_settings,
    evaluate_set,
    open_test_data,
    report_evaluation,
)
from stereoforge.progress import console
from stereoforge_kit.files import write_text
from training.devices import computes_in_bfloat16, parse_device
from training.runs.request import TrainingRequest
from training.runs.train import train

NETWORKS = ("regressor", "confnet", "gradnet")
TOO_FEW = " They are too few for error bars."
SHIPPED_METHODS = ("regressor", "gradnet", "ours", "ours_conf_gt")
"""What is run with the bundled weights, to show what more training brings."""


@dataclass(frozen=True)
class DemoPlan:
    """How much of everything; the defaults filled 11 minutes on two slow cores, installing included."""

    world: FlyingThingsConfig = field(
        default_factory=lambda: FlyingThingsConfig(
            width=384, height=192, frames=4, background_objects=(60, 90)
        )
    )
    scenes: dict[str, int] = field(default_factory=lambda: {"train": 18, "val": 3, "test": 4})
    steps: dict[str, int] = field(default_factory=lambda: {"regressor": 450, "confnet": 130, "gradnet": 130})
    """Training steps of each network's `tiny` preset."""
    samples: int = 2
    """Paths a pixel."""
    gallery_scenes: int = 16


@dataclass(frozen=True)
class DemoResult:
    """Where everything is, and the numbers."""

    data: Path
    weights: Path
    gallery: Path
    report: Path
    evaluation: Evaluation
    """Of the networks trained here."""
    bundled: Evaluation
    """Of the networks that come with StereoForge, on the same frames."""
    minutes: float
    """Of all runs that it took."""
    seconds: dict[str, float]
    """Of each stage of this run, by its title."""


def run_demo(out: Path, plan: DemoPlan | None = None, device: str = "auto") -> DemoResult:
    """Run every stage, each continuing what an earlier run left; raises what the stages raise.

    Args:
        out: Folder for everything.
        plan: How much of everything.
        device: What the networks run on, as `training.devices.parse_device` takes it.
    """
    bfloat16 = computes_in_bfloat16("auto", parse_device(device))  # before anything is rendered
    plan = plan or DemoPlan()
    clock = _Clock(out / "seconds.txt")
    data, weights = out / "data", out / "weights"
    with clock.stage(f"rendering {sum(plan.scenes.values()) * plan.world.frames} stereo pairs"):
        render_all(Recipe(plan.world, plan.scenes, samples=plan.samples), data)
    gallery = out / "gallery.html"
    with clock.stage("making the gallery"):
        write_gallery(data, gallery, scenes=plan.gallery_scenes)
    for network in NETWORKS:
        with clock.stage(f"training the {network}, {plan.steps[network]} steps"):
            train(
                TrainingRequest(
                    network,
                    ((data, 1.0),),
                    weights,
                    "tiny",
                    network="costvolume",
                    steps=plan.steps[network],
                    resume=True,
                    device=device,
                    precision="bf16" if bfloat16 else "32",
                )
            )
    (test,) = open_test_data([str(data)], "test")
    # There is no time to choose parameters here; the bundled ones were chosen on a validation set of such worlds.
    settings = open_settings(None, BUNDLED_WEIGHTS)
    with clock.stage(f"refining and evaluating {len(test.frames)} test pairs"):
        evaluated = evaluate_set(test, open_predictors(weights, device), settings.rows())
    with clock.stage("the same with the networks that come with StereoForge"):
        bundled = _evaluate_bundled(test, settings, device)
    minutes = clock.seconds / 60
    files = report_evaluation(
        [evaluated, bundled],
        weights,
        out / "report",
        limits=_limits(plan, minutes),
        title="StereoForge demo",
        facts={"Parameters": describe_settings(settings)},
    )
    return DemoResult(
        data, weights, gallery, files.html, evaluated.evaluation, bundled.evaluation, minutes, clock.stages
    )


def _evaluate_bundled(test: TestData, settings: Settings, device: str) -> EvaluatedSet:
    """The bundled weights on the demo's test frames."""
    facts = {**test.facts, "Networks": "bundled: " + "; ".join(describe_networks(BUNDLED_WEIGHTS))}
    named = replace(test, name=f"{test.name}, bundled weights", facts=facts)
    return evaluate_set(named, open_predictors(BUNDLED_WEIGHTS, device), settings.rows(SHIPPED_METHODS))


class _Clock:
    """Adds up the time of the stages, in a file, since a demo may be made in several runs."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.stages: dict[str, float] = {}
        """Seconds of each stage of this run, by its title."""
        try:
            self.seconds = float(path.read_text())
        except (OSError, ValueError):
            self.seconds = 0.0

    @contextmanager
    def stage(self, title: str) -> Iterator[None]:
        """Say what is being done, and how long it took; what was interrupted counts, too."""
        started = time.monotonic()
        console.print(f"{title} ...")
        try:
            yield
        finally:
            passed = time.monotonic() - started
            self.seconds += passed
            self.stages[title] = passed
            write_text(self._path, f"{self.seconds:.0f}\n")
        console.print(f"    {passed:.0f} s")


def _limits(plan: DemoPlan, minutes: float) -> tuple[str, ...]:
    """What a reader of the demo's numbers must know."""
    world, scenes = plan.world, plan.scenes
    pairs = {split: count * world.frames for split, count in scenes.items()}
    steps = ", ".join(f"{name} {count}" for name, count in plan.steps.items())
    return (
        f"Everything here was made in {minutes:.0f} minutes: {pairs['train']} training pairs of "
        f"{world.width}x{world.height} from {scenes['train']} scenes, {steps} training steps.",
        "The paper trained on 22,390 pairs of 960x540 for days on a GPU. Expect its error pattern here (halos "
        "around objects, which the MRF removes), not its accuracy.",
        f"The {pairs['test']} test pairs come from {scenes['test']} other scenes: they share no scene, mesh or "
        "texture with the training set." + TOO_FEW * (scenes["test"] < FEWEST_SCENES),
    )


def summary_table(evaluation: Evaluation, title: str) -> Table:
    """The main numbers for the terminal."""
    table = Table(title=title, title_justify="left")
    for heading in (
        "method",
        "bad > 1 px, all",
        "EPE, all",
        "bad, occluded",
        "EPE, occluded",
        "gradient error, smooth",
    ):
        table.add_column(heading, justify="left" if heading == "method" else "right")
    for name, score in evaluation.scores.items():
        everywhere, occluded = score.regions["all"], score.regions["occ"]
        table.add_row(
            evaluation.labels[name],
            *(
                "" if value != value else text.format(value)
                for text, value in (
                    ("{:.1%}", everywhere.bad),
                    ("{:.2f} px", everywhere.epe),
                    ("{:.1%}", occluded.bad),
                    ("{:.2f} px", occluded.epe),
                    ("{:.3f}", score.gradient_masked),
                )
            ),
        )
    return table

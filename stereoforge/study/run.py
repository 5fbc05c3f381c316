"""A study as a list of jobs, each in a folder named by what decides its result, and the results they add up to.

Under the study's folder: `data/`, `networks/`, `parameters/`, `runs/` (the networks of one training domain together, as
every other command takes them), `evaluations/`, `statistics/`, and `results/`, which is small enough to keep.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path

from datagen import Recipe
from datagen.dataset.samples import open_layout
from datagen.errors import DatasetError
from datagen.sources.ground_truth import require_ground_truth
from datagen.sources.registry import open_source
from refine.evaluation.archive import read_evaluation, write_evaluation
from refine.evaluation.evaluate import EvaluationOptions
from refine.registry import table_order
from scenes.serialization import to_plain
from stereoforge.errors import CommandError, UsageError
from stereoforge.pipelines.forest import PLANS, train_forest
from stereoforge.pipelines.parameter_search import VALIDATION, Tuning, validation_frames
from stereoforge.pipelines.parameter_search import describe as describe_tuning
from stereoforge.pipelines.prediction import (
    forest_file,
    network_digests,
    open_predictors,
    open_settings,
    parameters_file,
)
from stereoforge.pipelines.rendering import render_all
from stereoforge.pipelines.set_evaluation import TestData, evaluate_set, evaluation_options, family_of
from stereoforge.study.jobs import Job, make_job, run_jobs
from stereoforge.study.plan import NETWORKS, TEST_SPLITS, TRAINING_SPLITS, StudyPlan
from stereoforge.study.results import StudyResult, write_results
from stereoforge.study.statistics import describe, read_statistics, write_statistics
from stereoforge_kit.files import alone, write_bytes
from training.preset_kinds import Preset
from training.presets import change_preset, find_preset
from training.runs.model_card import write_model_card
from training.runs.request import TrainingRequest
from training.runs.train import train
from training.runs.weights import copy_weights

PANELS = EvaluationOptions(first_panels=2, worst_panels=1)
"""Fewer pictures than `evaluate` shows: there are many sets."""
REFERENCE_METHODS = ("regressor", "gradnet", "ours", "ours_conf_gt")
"""What is run with the networks of domains other than the subject."""

# Seconds on two cores of 2020, the first guess of the time left.
PAIR_SECONDS = 1.8  # of 384x192
STEP_SECONDS = {"regressor": 0.2, "regressor_f": 0.2, "confnet": 0.15, "gradnet": 0.15}
FRAME_SECONDS = {True: 6.0, False: 1.5}  # with every method, with a few
TUNING_SECONDS = 60.0  # a frame


def run_study(
    plan: StudyPlan, out: Path, *, presets: Mapping[str, Preset] | None = None, device: str = "cpu"
) -> StudyResult:
    """Do what is missing of a study and write its results into `out/results`; again to finish or change it.

    Args:
        presets: Of each network, instead of the plan's by name.
        device: What the networks are trained and run on.

    Raises:
        UsageError: A data set without splits is to be trained and tested on.
        CommandError, DatasetError, TrainingError: What its steps raise.
    """
    study = _Study(plan, out, presets, device)
    busy = CommandError(
        f"{out}: another process is at this study right now; wait for it, or choose another folder"
    )
    # Two would do each step, into the same files.
    with alone(out / LOCK, busy):
        run_jobs(study.jobs)
        return write_results(
            plan,
            out / "results",
            cells={key: read_evaluation(job.folder) for key, job in study.evaluations.items()},
            fine_tuned={name: read_evaluation(job.folder) for name, job in study.fine_tuned.items()},
            statistics={
                name: read_statistics(job.folder / STATISTICS) for name, job in study.statistics.items()
            },
            weights=study.runs[plan.subject].folder,
        )


FOREST = "rdf"
"""The random forest among a domain's networks."""
STATISTICS = "statistics.json"
LOCK = ".lock"


@dataclass(frozen=True)
class _Data:
    """Where a domain's frames for one purpose are, and what identifies them."""

    source: str
    key: str
    job: Job | None = None
    """What renders them."""


class _Study:
    """The jobs of a study, each made when another asks for it."""

    def __init__(self, plan: StudyPlan, out: Path, presets: Mapping[str, Preset] | None, device: str) -> None:
        self.plan, self.out, self.device = plan, out, device
        self.presets = presets or {}
        for name in plan.train:
            if name in plan.test and not self._has_splits(name):
                raise UsageError(
                    f"{plan.domains[name].source}: has no splits of its own, so it would be tested on what it was "
                    "trained on; give two parts of it, such as SOURCE#0-99 to train and SOURCE#100-199 to test on"
                )

    def _has_splits(self, name: str) -> bool:
        source = self.plan.domains[name].source
        return source is None or len(open_source(source).splits) > 0

    @cached_property
    def adapted_domains(self) -> tuple[str, ...]:
        """Those that the subject is fine-tuned on."""
        if not self.plan.fine_tuning_steps:
            return ()
        return tuple(name for name in self.plan.test if name != self.plan.subject and self._has_splits(name))

    @property
    def jobs(self) -> list[Job]:
        """All, in an order in which each finds what it needs."""
        data = [*self.training_data.values(), *self.tuning_data.values(), *self.test_data.values()]
        return [
            *(each.job for each in data if each.job is not None),
            *self.statistics.values(),
            *(job for networks in self.networks.values() for job in networks.values()),
            *self.tuning.values(),
            *self.runs.values(),
            *self.evaluations.values(),
            *self.adapted.values(),
            *self.fine_tuned.values(),
        ]

    @cached_property
    def training_data(self) -> dict[str, _Data]:
        names = dict.fromkeys((*self.plan.train, *self.adapted_domains))
        return {name: self._data(name, "train", TRAINING_SPLITS) for name in names}

    @cached_property
    def test_data(self) -> dict[str, _Data]:
        return {name: self._data(name, "test", TEST_SPLITS) for name in self.plan.test}

    @cached_property
    def tuning_data(self) -> dict[str, _Data]:
        """What parameters are chosen on, where the plan asks for it and there are validation frames."""
        if not self.plan.tuning_frames:
            return {}
        return {name: self._tuning_data(name) for name in self.plan.train if self._has_validation(name)}

    def _tuning_data(self, name: str) -> _Data:
        if self.plan.domains[name].source is not None:
            return self.training_data[name]
        return self._rendered(name, "choose parameters", "tune", self.plan.tuning_recipe(name))

    def _data(self, name: str, purpose: str, splits: tuple[str, ...]) -> _Data:
        source = self.plan.domains[name].source
        if source is not None:
            return _Data(source, _fingerprint(source, splits))
        return self._rendered(name, purpose, purpose, self.plan.recipe(name, splits))

    def _rendered(self, name: str, verb: str, purpose: str, recipe: Recipe) -> _Data:
        pairs = sum(recipe.scenes.values()) * recipe.world.frames
        seconds = pairs * PAIR_SECONDS * recipe.world.width * recipe.world.height / (384 * 192)
        job = make_job(
            self.out / "data",
            f"{name}-{purpose}",
            f"rendering {pairs} pairs of {name} to {verb} on",
            {"recipe": to_plain(recipe)},
            seconds,
            lambda folder: render_all(recipe, folder / DATASET),
        )
        return _Data(str(job.folder / DATASET), job.key, job)

    @cached_property
    def statistics(self) -> dict[str, Job]:
        def run(name: str, folder: Path) -> None:
            frames = open_source(self.test_data[name].source).frames("test")
            write_statistics(folder / STATISTICS, describe(frames))

        return {
            name: make_job(
                self.out / "statistics", name, f"measuring {name}", {"data": data.key}, 10, partial(run, name)
            )
            for name, data in self.test_data.items()
        }

    @cached_property
    def networks(self) -> dict[str, dict[str, Job]]:
        """By training domain and task; regressors first, since the others are built on them."""
        return {name: self._networks_of(name) for name in self.plan.train}

    def _networks_of(self, name: str) -> dict[str, Job]:
        jobs: dict[str, Job] = {}
        for task in NETWORKS if self._compares_fine_tuning(name) else NETWORKS[:-1]:
            steps = self.plan.domains[name].steps.get(task)
            jobs[task] = self._training_job(name, task, name, steps, jobs.get("regressor"))
        if self.plan.forest and name == self.plan.subject:
            jobs[FOREST] = self._forest_job(name, jobs["regressor"])
        return jobs

    def _compares_fine_tuning(self, name: str) -> bool:
        """Whether `regressor_f` is a row of any table of the networks of this domain."""
        return any("regressor_f" in self._methods(name, test) for test in self.plan.test)

    def _forest_job(self, name: str, regressor: Job) -> Job:
        data, forest = self.training_data[name], PLANS[self.plan.preset]

        def run(folder: Path) -> None:
            copy_weights(regressor.folder, folder, "regressor")
            forest_file(folder).unlink(missing_ok=True)  # of a run that was stopped before it said so
            train_forest([data.source], folder, forest, self.plan.seed, self.device)

        settings = {
            "forest": asdict(forest),
            "seed": self.plan.seed,
            "data": data.key,
            "regressor": regressor.key,
        }
        seconds = forest.frames * FRAME_SECONDS[False]
        return make_job(
            self.out / "networks", f"{name}-{FOREST}", f"growing the forest on {name}", settings, seconds, run
        )

    def _training_job(self, name: str, task: str, domain: str, steps: int | None, init: Job | None) -> Job:
        preset = self.presets.get(task) or find_preset(task, self.plan.preset, self.plan.network)
        curriculum = self.plan.domains[domain].curriculum
        changes = {"curriculum": curriculum} if curriculum and task == "regressor" else {}
        preset = change_preset(preset, changes)
        data = self.training_data[domain]
        steps = preset.steps if steps is None else steps
        settings = {
            "task": task,
            "preset": asdict(preset),
            "steps": steps,
            "seed": self.plan.seed,
            "data": data.key,
            "init": init.key if init else None,
        }

        def run(folder: Path) -> None:
            request = TrainingRequest(
                task=task,
                data=((data.source, 1.0),),
                out=folder,
                preset=self.presets.get(task, self.plan.preset),
                network=self.plan.network,
                changes=changes,
                init=init.folder if init else None,
                resume=True,
                steps=steps,
                seed=self.plan.seed,
                device=self.device,
            )
            train(request)

        title = f"training the {task} on {domain}, {steps} steps"
        return make_job(
            self.out / "networks", f"{name}-{task}", title, settings, steps * STEP_SECONDS[task], run
        )

    @cached_property
    def tuning(self) -> dict[str, Job]:
        """Choosing the methods' parameters."""
        return {name: self._tuning_job(name, data) for name, data in self.tuning_data.items()}

    def _has_validation(self, name: str) -> bool:
        domain = self.plan.domains[name]
        if domain.source is None:
            return domain.scenes.get("val", 0) > 0
        return len(open_source(domain.source).validation_frames()) > 0

    def _tuning_job(self, name: str, data: _Data) -> Job:
        jobs, count = self.networks[name], self.plan.tuning_frames

        def run(folder: Path) -> None:
            collected = _collect(jobs, folder / "networks")
            predictors = open_predictors(collected, self.device)
            frames = validation_frames([open_source(data.source)], predictors, count)
            about = describe_tuning(frames, [data.source], "balanced", network_digests(collected))
            Tuning(frames, parameters_file(folder), about).run(self._tuned_methods(name))

        settings = {
            "networks": {task: job.key for task, job in jobs.items()},
            "frames": count,
            "data": data.key,
            "methods": list(self._tuned_methods(name)),
        }
        title = f"choosing the methods' parameters on {count} frames of {name}"
        return make_job(self.out / "parameters", name, title, settings, count * TUNING_SECONDS, run)

    @cached_property
    def runs(self) -> dict[str, Job]:
        """Run folders as every command takes them."""

        def run(name: str, folder: Path) -> None:
            _collect(self.networks[name], folder)
            if name in self.tuning:
                write_bytes(parameters_file(folder), parameters_file(self.tuning[name].folder).read_bytes())
            write_model_card(folder)

        return {
            name: make_job(
                self.out / "runs",
                name,
                f"collecting the networks of {name}",
                {
                    "networks": {task: job.key for task, job in jobs.items()},
                    "parameters": self.tuning[name].key if name in self.tuning else None,
                },
                0.1,
                partial(run, name),
            )
            for name, jobs in self.networks.items()
        }

    @cached_property
    def evaluations(self) -> dict[tuple[str, str], Job]:
        """By (trained on, tested on)."""
        return {
            (name, test): self._evaluation_job(
                self.runs[name], f"{name}-on-{test}", test, self._methods(name, test)
            )
            for name in self.plan.train
            for test in self.plan.test
        }

    @cached_property
    def adapted(self) -> dict[str, Job]:
        """The subject's regressor, trained further on each other domain."""
        subject = self.plan.subject
        init = self.networks[subject]["regressor"]
        return {
            name: self._training_job(
                f"{subject}-to-{name}", "regressor", name, self.plan.fine_tuning_steps, init
            )
            for name in self.adapted_domains
        }

    @cached_property
    def fine_tuned(self) -> dict[str, Job]:
        subject = self.plan.subject
        return {
            name: self._evaluation_job(job, f"{subject}-to-{name}-on-{name}", name, ("regressor",))
            for name, job in self.adapted.items()
        }

    def _evaluation_job(self, run: Job, name: str, test: str, methods: tuple[str, ...]) -> Job:
        data = self.test_data[test]

        def evaluate(folder: Path) -> None:
            frames = open_source(data.source).frames("test")
            require_ground_truth(data.source, frames)
            family = family_of(data.source, frames)
            facts = {"Source": data.source, "Networks": run.folder.name}
            rows = open_settings(None, run.folder).rows(methods)
            options = replace(PANELS, bad_threshold=evaluation_options(family).bad_threshold)
            predictors = open_predictors(run.folder, self.device)
            tested = TestData(test, frames, family, "test", facts)
            write_evaluation(folder, evaluate_set(tested, predictors, rows, options))

        settings = {"networks": run.key, "data": data.key, "methods": list(methods), "panels": asdict(PANELS)}
        scenes = self.plan.domains[test].scenes.get("test", 25)
        seconds = 4 * scenes * FRAME_SECONDS[len(methods) > len(REFERENCE_METHODS)]
        return make_job(self.out / "evaluations", name, f"evaluating {name}", settings, seconds, evaluate)

    def _tuned_methods(self, name: str) -> tuple[str, ...]:
        return (self.plan.methods or table_order()) if name == self.plan.subject else REFERENCE_METHODS

    def _methods(self, name: str, test: str) -> tuple[str, ...]:
        own = self.plan.domains[test].methods if name == self.plan.subject else ()
        return own or self._tuned_methods(name)


DATASET = "set"
"""Folder of a rendered data set inside its job's."""


def _collect(networks: Mapping[str, Job], folder: Path) -> Path:
    """Put the networks of several folders into one."""
    for task, job in networks.items():
        if task == FOREST:
            write_bytes(forest_file(folder), forest_file(job.folder).read_bytes())
        else:
            copy_weights(job.folder, folder, task)
    return folder


def _fingerprint(source: str, splits: tuple[str, ...]) -> str:
    """Identifies somebody's data set: its frames' names and size, and the manifests of a set of ours.

    Raises DatasetError for a set that is missing or has none of the splits.
    """
    opened = open_source(source)
    present = [split for split in splits if not opened.splits or split in opened.splits]
    digest = hashlib.sha256(source.encode())
    for split in present or splits:
        try:
            frames = opened.frames(split)
        except DatasetError:
            if split == VALIDATION:
                continue
            raise
        digest.update(repr((split, frames[0].size, [frame.name for frame in frames])).encode())
        if opened.format.name.startswith("native"):
            layout = open_layout(opened.location)
            for scene in layout.committed_scenes(split):
                digest.update(layout.manifest(split, scene).read_bytes())
    return digest.hexdigest()

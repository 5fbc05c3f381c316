"""Evaluate networks and methods on data sets, and report it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from datagen import DatasetError, StereoSample
from datagen.dataset.manifest import read_manifest
from datagen.formats.impossible_disparity import ImpossibleShare
from datagen.sources.ground_truth import mean_share, require_ground_truth
from datagen.sources.missing import ChosenFrames, describe_missing, missing_files
from datagen.sources.registry import open_source
from datagen.sources.stereo_frame import StereoFrame
from datagen.sources.webdataset import ShardFrames
from refine.evaluation.evaluate import EvaluationFrame, EvaluationOptions, evaluate
from refine.evaluation.results import EvaluatedSet
from refine.evaluation.settings import Settings
from refine.method import Method
from refine.report.write import ReportContext, ReportFiles, write_report
from stereoforge.inputs.images import pair_doubts
from stereoforge.pipelines.prediction import Predictors
from stereoforge.progress import progress_bar, remark
from training.presets import TASKS
from training.runs.weights import has_weights, read_summary

KITTI_BAD_PX = 3.0
"""KITTI's threshold of a bad pixel; everybody else's is 1 px."""


@dataclass(frozen=True)
class TestData:
    """Frames to evaluate on, with the facts that the report shows of them."""

    name: str
    frames: Sequence[StereoFrame]
    family: str
    """The family of our worlds, or the format of somebody else's data set."""
    split: str
    facts: Mapping[str, str] = field(default_factory=dict)

    __test__ = False
    """Not a test, whatever pytest thinks of its name."""


def open_test_data(sources: Sequence[str], split: str, *, skip_broken: bool = False) -> list[TestData]:
    """Open data sets as `datagen.sources.registry` takes them.

    Raises DatasetError, naming what is wrong: a set without a single pixel of ground truth, or with missing files.
    With `skip_broken` the frames that lack files are left out, and it is said which.

    A set is called after its folder, or by all of its source where two folders have one name.
    """
    short = [Path(source.partition("#")[0]).name or source for source in sources]
    names = [name if short.count(name) == 1 else source for name, source in zip(short, sources, strict=True)]
    opened = []
    for name, source in zip(names, sources, strict=True):
        data = open_source(source)
        frames = data.frames(split)
        require_ground_truth(source, frames)
        family = family_of(source, frames)
        facts = {"Source": source, "Split": split} | ({"Family": family} if family else {})
        if note := data.note:
            facts["Files"] = note
            remark(f"{name}: {note}")
        if missing := missing_files(frames):
            sentence = describe_missing(source, missing, len(frames))
            if not skip_broken:
                raise DatasetError(f"{source}: {sentence}; --skip-broken evaluates the other frames")
            facts["Left out"] = sentence
            remark(f"{name}: left out: {sentence}")
            frames = ChosenFrames(frames, [i for i in range(len(frames)) if i not in missing])
        opened.append(TestData(name, frames, family, split, facts))
    return opened


def family_of(source: str, frames: Sequence[StereoFrame]) -> str:
    """The family that rendered a set of ours, as the first scene's manifest or the first sample of shards says; else
    the format's name. Raises DatasetError."""
    if isinstance(frames, ShardFrames) and frames.family is not None:
        return frames.family
    first = frames[0]
    if isinstance(first, StereoSample):
        return read_manifest(first.layout.manifest(first.split, first.scene)).family
    return open_source(source).format.name


def evaluation_options(
    family: str, bad_threshold: float | None = None, posterior_samples: int = 0
) -> EvaluationOptions:
    """The measures' thresholds: those asked for, or the data's custom."""
    custom = KITTI_BAD_PX if family.startswith("kitti") else EvaluationOptions().bad_threshold
    return EvaluationOptions(
        bad_threshold=custom if bad_threshold is None else bad_threshold, posterior_samples=posterior_samples
    )


def evaluate_set(
    data: TestData,
    predictors: Predictors,
    methods: tuple[Method, ...] = (),
    options: EvaluationOptions | None = None,
    *,
    skip_broken: bool = False,
    prepare: Callable[[EvaluationFrame], EvaluationFrame] | None = None,
) -> EvaluatedSet:
    """Run the networks and every method on every frame, showing progress, and say what is wrong with the set.

    `prepare` changes each frame before it is scored, such as the ground truth that counts.
    With `skip_broken`, frames that cannot be read are left out, and it is said which; otherwise DatasetError is raised
    at the first. It is raised too if none is left.
    """
    doubts = _Doubts()
    with progress_bar() as progress:
        what = f"evaluating on {data.name}"
        task = progress.add_task(f"{what} (compiling, after an install)", total=len(data.frames))
        predicted = _predicted(data.frames, predictors, doubts, skip_broken)
        evaluation = evaluate(
            predicted if prepare is None else map(prepare, predicted),
            methods,
            options or evaluation_options(data.family),
            progress=lambda done, _: progress.update(task, completed=done, description=what),
        )
    facts = dict(data.facts)
    if impossible := mean_share(doubts.shares):
        facts["Ground truth"] = str(impossible)
        remark(f"{data.name}: {impossible}")
    if doubts.broken:
        facts["Damaged"] = (
            f"left out, since they cannot be read: {len(doubts.broken)} of {len(data.frames)} frames, first "
            f"{doubts.broken[0]}"
        )
        remark(f"{data.name}: {facts['Damaged']}")
    for sentence, frames in doubts.pairs.items():
        remark(f"{data.name}: {frames[0]}{f' and {len(frames) - 1} more' * (len(frames) > 1)}: {sentence}")
    return EvaluatedSet(data.name, evaluation, data.family, data.split, facts)


@dataclass
class _Doubts:
    """What is odd about the frames of a set."""

    shares: list[ImpossibleShare] = field(default_factory=list)
    """How much of each frame's ground truth cannot be."""
    pairs: dict[str, list[str]] = field(default_factory=dict)
    """Names of frames by what is wrong with their pictures."""
    broken: list[str] = field(default_factory=list)
    """What is wrong with the frames that cannot be read."""


def _predicted(
    frames: Sequence[StereoFrame], predictors: Predictors, doubts: _Doubts, skip_broken: bool
) -> Iterator[EvaluationFrame]:
    """Every frame with its predictions; `doubts` receives what is odd about it.

    The first one's are made twice: what a first run compiles and allocates is not the predictors' time.
    """
    for frame in frames:
        try:
            if not doubts.shares:
                predictors.frame(frame)
            predicted = predictors.frame(frame)
        except DatasetError as error:
            if not skip_broken:
                raise
            doubts.broken.append(str(error))
            continue
        doubts.shares.append(frame.impossible_left)
        for sentence in pair_doubts(frame.left, frame.right):
            doubts.pairs.setdefault(sentence, []).append(frame.name)
        yield predicted
    if not doubts.shares:
        raise DatasetError(
            f"no frame is left that can be read: {doubts.broken[0] if doubts.broken else 'all lack files'}"
        )


def report_evaluation(
    sets: Sequence[EvaluatedSet],
    weights: Path,
    out: Path,
    *,
    limits: tuple[str, ...] = (),
    title: str = "StereoForge evaluation",
    facts: Mapping[str, str] | None = None,
    bootstrap_seed: int = 0,
    sections: str = "",
    compact: bool = False,
) -> ReportFiles:
    """Write the report, saying what was evaluated with what; the arguments are those of `ReportContext`."""
    context = ReportContext(
        title=title,
        facts={"Weights": "; ".join(describe_networks(weights)), **(facts or {})},
        limits=limits,
        bootstrap_seed=bootstrap_seed,
        sections=sections,
        compact=compact,
    )
    return write_report(sets, out, context)


def describe_settings(settings: Settings) -> str:
    """Where the methods' parameters come from."""
    if not settings.methods:
        return "the methods' defaults"
    frames = len(settings.about.get("frames", ()))
    data = ", ".join(map(str, settings.about.get("data", ())))
    return f"chosen on {frames} validation frames of {data}"


def describe_networks(weights: Path) -> Iterator[str]:
    """A phrase for each network of a run folder."""
    for task in TASKS:
        if has_weights(weights, task):
            summary = read_summary(weights, task)
            yield f"{task} ({summary.preset}, step {summary.best_step} of {summary.steps})"

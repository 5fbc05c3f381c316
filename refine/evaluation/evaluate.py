"""Running methods over frames and adding up what they get wrong: the numbers of the paper's Tables 1-5, Figs
4-6.

Frames are read one at a time and dropped, but for the few whose pictures the report shows.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from refine.evaluation.pooling import MethodPool, MethodScore
from refine.method import EvaluationFrame, Method
from refine.metrics import SparsificationCurve, bad_pixel_rate, optimal_auc, sparsification_curve
from refine.registry import default_methods
from stereoforge_kit.errors import InputError
from stereoforge_kit.messages import listed

__all__ = [
    "Evaluation",
    "EvaluationFrame",
    "EvaluationOptions",
    "FrameScore",
    "Panel",
    "evaluate",
]


@dataclass(frozen=True)
class EvaluationOptions:
    """Thresholds of the measures, and how many frames to keep pictures of."""

    bad_threshold: float = 1.0
    """A disparity further off than this is bad, in pixels."""
    gradient_threshold: float = 1.0
    """Ground-truth forward differences above it are discontinuities, left out of the masked gradient
    error."""
    first_panels: int = 4
    """Frames shown because they come first, of as many scenes as there are."""
    posterior_samples: int = 0
    """Samples a frame by which the judged method's standard deviations are estimated; 0 leaves them out. Each takes as
    long as a refinement."""
    worst_panels: int = 3
    """Frames shown because `Evaluation.judged` has its largest end-point errors there, one a scene."""


@dataclass(frozen=True)
class FrameScore:
    """Everything measured on one frame."""

    name: str
    scene: str
    """Frames of one scene are resampled together."""
    pools: dict[str, MethodPool]
    """By method name; without the methods that could not run."""
    initial_bad: float
    """Bad rate of the initial disparity: the area under the curve of a random order."""
    optimal_auc: float
    curves: dict[str, SparsificationCurve]
    """Sparsification of the initial disparity by each confidence measure: "confnet" and the frame's
    others."""
    refined_aucs: dict[str, float] = field(default_factory=dict)
    """Areas under the curves of the judged method's disparity, not the initial one: by its "posterior" deviation and
    by "confnet", and the bounds. Empty without samples of the posterior."""

    @cached_property
    def methods(self) -> dict[str, MethodScore]:
        """The measures of each method on this frame."""
        return {name: pool.score() for name, pool in self.pools.items()}

    @property
    def has_truth(self) -> bool:
        """Whether any of its pixels has ground truth."""
        return bool(np.isfinite(self.initial_bad))

    @property
    def aucs(self) -> dict[str, float]:
        """Areas under the curves, and the bounds: "random" order (on average the bad rate) and "optimal"."""
        measured = {name: curve.auc for name, curve in self.curves.items()}
        return {**measured, "random": self.initial_bad, "optimal": self.optimal_auc}


@dataclass(frozen=True)
class Panel:
    """One frame kept whole, with every method's result, to be looked at."""

    frame: EvaluationFrame
    disparities: dict[str, NDArray[np.float32]]
    """By method name, for the methods that give a disparity."""
    order: int
    """Place of the frame in the set, from 0."""


@dataclass(frozen=True)
class Evaluation:
    """The result of `evaluate`."""

    options: EvaluationOptions
    labels: dict[str, str]
    """Method name to its name for readers, in the order of the tables."""
    upper_bounds: frozenset[str]
    """Methods that look at the ground truth."""
    scores: dict[str, MethodScore]
    """Pooled over all pixels of all frames on which the method ran."""
    skipped: dict[str, str]
    """Methods that could not run, and in a sentence without its full stop what they lacked."""
    frames: tuple[FrameScore, ...]
    first: tuple[Panel, ...]
    worst: tuple[Panel, ...]
    """Worst first."""
    judged: str
    """The method by which frames are called worst: "ours", or the first one where that did not run."""

    @property
    def refines(self) -> bool:
        """Whether the judged method does anything to the initial disparity."""
        return self.judged != "regressor"

    @property
    def measured_confidences(self) -> frozenset[str]:
        """Names of the confidence measures that some frame has, without the bounds."""
        return frozenset(name for frame in self.frames for name in frame.curves)


def evaluate(
    frames: Iterable[EvaluationFrame],
    methods: Sequence[Method] = (),
    options: EvaluationOptions = EvaluationOptions(),
    progress: Callable[[int, str], None] | None = None,
) -> Evaluation:
    """Run every method on every frame and measure the results.

    Args:
        frames: Read once, one at a time.
        methods: Rows of the tables, in order; `default_methods()` if empty. A method whose inputs the first
            frame lacks is skipped and listed.
        options: Thresholds and numbers of pictures.
        progress: Called after each frame with the number of frames done and the frame's name.

    Raises:
        ValueError: If there is no frame, no method can run, two methods share a name, or a later frame lacks
        an
            input that the first one had.
    """
    run = _Run(tuple(methods) or default_methods(), options)
    for frame in frames:
        run.take(frame)
        if progress is not None:
            progress(len(run.scores), frame.name)
    return run.finish()


class _Run:
    """An evaluation under way."""

    def __init__(self, methods: tuple[Method, ...], options: EvaluationOptions) -> None:
        names = [method.name for method in methods]
        if len(set(names)) != len(names):
            raise InputError(f"every method may be evaluated once, got {listed(names)}")
        self.methods = methods
        self.options = options
        self.skipped: dict[str, str] = {}
        self.pools: dict[str, MethodPool] = {}
        self.scores: list[FrameScore] = []
        self.first: dict[str, Panel] = {}
        self.spare: list[Panel] = []
        """The first frames that are not their scene's first, for when there are fewer scenes than panels."""
        self.worst: dict[str, tuple[float, Panel]] = {}

    def take(self, frame: EvaluationFrame) -> None:
        """Evaluate one frame."""
        if not self.scores:
            self._choose_methods(frame)
        if len(self.scores) == 1:
            # After an install the first run compiles for minutes, which are not the method's time.
            for known in self.pools.values():
                known.forget_seconds()
        pools, disparities = {}, {}
        for method in self.methods:
            if lacking := method.lacks(frame):
                raise InputError(f"frame {frame.name} comes without {lacking}, unlike the first frame")
            began = time.perf_counter()
            output = method.run(frame)
            pool = self._empty_pool()
            pool.add(frame, output, time.perf_counter() - began + output.seconds)
            self.pools[method.name].merge(pool)
            pools[method.name] = pool
            if output.disparity is not None:
                disparities[method.name] = output.disparity
        error = pools[self.judged].regions["all"].end_point_error
        self._keep(Panel(frame, disparities, order=len(self.scores)), error)
        refined_aucs = self._refined_aucs(frame, disparities)
        self.scores.append(replace(self._frame_score(frame, pools), refined_aucs=refined_aucs))

    def finish(self) -> Evaluation:
        """Pool the frames taken."""
        if not self.scores:
            raise InputError("there is no frame to evaluate")
        return Evaluation(
            options=self.options,
            labels={method.name: method.label for method in self.methods},
            upper_bounds=frozenset(method.name for method in self.methods if method.upper_bound),
            scores={name: pool.score() for name, pool in self.pools.items()},
            skipped=self.skipped,
            frames=tuple(self.scores),
            first=self._first_panels(),
            worst=tuple(panel for _, panel in sorted(self.worst.values(), key=lambda entry: -entry[0])),
            judged=self.judged,
        )

    def _choose_methods(self, frame: EvaluationFrame) -> None:
        self.skipped = {
            method.name: f"{method.label} needs {method.lacks(frame)}, which the frames come without"
            for method in self.methods
            if method.missing(frame)
        }
        self.methods = tuple(method for method in self.methods if method.name not in self.skipped)
        if not self.methods:
            raise InputError(
                f"no method can run: {listed([*self.skipped.values()], most=2, longest=110, separator='; ')}"
            )
        self.pools = {method.name: self._empty_pool() for method in self.methods}
        self.judged = "ours" if "ours" in self.pools else self.methods[0].name

    def _empty_pool(self) -> MethodPool:
        return MethodPool.empty(self.options.bad_threshold, self.options.gradient_threshold)

    def _keep(self, panel: Panel, error: float) -> None:
        """Keep the frame's arrays if it is among the first or, so far, among the worst; one frame a scene."""
        scene = panel.frame.scene or panel.frame.name
        if len(self.first) < self.options.first_panels:
            if scene not in self.first:
                self.first[scene] = panel
            elif len(self.spare) < self.options.first_panels:
                self.spare.append(panel)
        if np.isfinite(error) and error > self.worst.get(scene, (-1.0,))[0]:
            self.worst[scene] = error, panel
            if len(self.worst) > self.options.worst_panels:
                del self.worst[min(self.worst, key=lambda name: self.worst[name][0])]

    def _first_panels(self) -> tuple[Panel, ...]:
        """The first frame of each of the first scenes, and further ones of them where there are few, in order."""
        chosen = [*self.first.values(), *self.spare][: self.options.first_panels]
        return tuple(sorted(chosen, key=lambda panel: panel.order))

    def _refined_aucs(
        self, frame: EvaluationFrame, disparities: dict[str, NDArray[np.float32]]
    ) -> dict[str, float]:
        """How well the judged method's own deviations, and ConfNet, tell its wrong disparities from its right ones."""
        method = next(method for method in self.methods if method.name == self.judged)
        samples, refined = self.options.posterior_samples, disparities.get(self.judged)
        deviation = method.deviation(frame, samples) if samples and refined is not None else None
        if deviation is None or refined is None:
            return {}
        measures = {"posterior": -deviation}
        if frame.confidence is not None:
            measures["confnet"] = frame.confidence
        threshold = self.options.bad_threshold
        bad = bad_pixel_rate(refined, frame.truth, threshold)
        bounds = {"random": bad, "optimal": _optimal_auc(bad)}
        return {
            name: sparsification_curve(refined, frame.truth, values, threshold).auc
            for name, values in measures.items()
        } | bounds

    def _frame_score(self, frame: EvaluationFrame, pools: dict[str, MethodPool]) -> FrameScore:
        threshold = self.options.bad_threshold
        measures = dict(frame.other_confidences)
        if frame.confidence is not None:
            measures = {"confnet": frame.confidence, **measures}
        curves = {
            name: sparsification_curve(frame.disparity, frame.truth, values, threshold)
            for name, values in measures.items()
        }
        bad = bad_pixel_rate(frame.disparity, frame.truth, threshold)
        return FrameScore(
            name=frame.name,
            scene=frame.scene or frame.name,
            pools=pools,
            initial_bad=bad,
            optimal_auc=_optimal_auc(bad),
            curves=curves,
        )


def _optimal_auc(bad: float) -> float:
    """The least possible area for a bad rate; NaN for a frame without ground truth, which has none."""
    return optimal_auc(bad) if np.isfinite(bad) else float("nan")

"""Choose a method's parameters on frames with ground truth: a coordinate search over short lists of values.

Each method names its parameters and their values in order (`Method.search`). The search starts from the defaults and
takes the parameters in turn: it moves along a parameter's values, up and else down, as long as the objective falls,
and goes round again until a whole round gains next to nothing. Two that make up for one another (`Method.tied`) are
moved together too: alone neither can leave a valley that runs aslant. That finds the best of all combinations only
where the parameters act apart, but tries some tens of settings where the whole grid has thousands.

Most settings are worse than the best so far, and a part of the frames tells. So frames come in stages
(`stages_of`), and a setting that is clearly behind after one is given up, as in successive halving (Jamieson and
Talwalkar, AISTATS 2016).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal

from refine.method import EvaluationFrame, Method
from refine.metrics import ErrorPool, GradientPool, forward_gradient, smooth_mask
from stereoforge_kit.errors import InputError

Objective = Literal["balanced", "bad", "epe", "gradient"]
"""Error relative to the initial disparity's: the mean of the three, bad pixels, end-point error, gradient error."""

ROUNDS = 10
"""At most so many rounds over the parameters. After three, the first had not felt where the last went."""
LEAST_GAIN = 1e-3
"""A round that lowers the objective by less than this is the last."""
FEWEST_STAGED = 8
"""Fewer frames are one stage: a quarter of them would not tell settings apart."""
CLEARLY_BEHIND = 0.02
"""A setting is given up where its objective exceeds the best one's by more than this share of it after the same
frames."""


@dataclass(frozen=True)
class Errors:
    """A method's pooled errors over all pixels of some frames."""

    bad: float
    epe: float
    gradient: float
    """Where the ground truth is smooth."""


@dataclass(frozen=True)
class Trial:
    """One setting of a method and what came of it."""

    setting: Mapping[str, Any]
    """Values of the searched parameters, by their paths."""
    objective: float
    """Infinite where a ratio is not defined, and where it was given up (`Race`)."""


@dataclass(frozen=True)
class TunedMethod:
    """A method with the best parameters found."""

    method: Method
    trials: tuple[Trial, ...]
    """In the order they were tried, the defaults first."""

    @classmethod
    def best_of(cls, kind: type[Method], trials: Sequence[Trial]) -> TunedMethod:
        """The method with the best setting of some trials."""
        best: Any = kind()
        for path, value in min(trials, key=lambda trial: trial.objective).setting.items():
            best = with_value(best, path, value)
        return cls(best, tuple(trials))

    @property
    def objective(self) -> float:
        """The least objective found."""
        return min(trial.objective for trial in self.trials)

    @property
    def default_objective(self) -> float:
        """The objective of the default parameters."""
        return self.trials[0].objective


def measure(method: Method, frames: Iterable[EvaluationFrame], bad_threshold: float = 1.0) -> Errors:
    """Run a method that gives disparities on every frame and pool its errors."""
    return next(measure_in_stages(method, (frames,), bad_threshold))


def measure_in_stages(
    method: Method, stages: Iterable[Iterable[EvaluationFrame]], bad_threshold: float = 1.0
) -> Iterator[Errors]:
    """Run a method that gives disparities on frames, and give after each stage the errors on all frames so far."""
    errors, gradients = ErrorPool(bad_threshold), GradientPool()
    for frames in stages:
        for frame in frames:
            disparity = method.run(frame).disparity
            if disparity is None:
                raise InputError(
                    f"{method.name} gives no disparity, so its parameters cannot be validated by one"
                )
            truth = forward_gradient(frame.truth)
            errors.add(disparity, frame.truth)
            gradients.add(forward_gradient(disparity), truth, smooth_mask(truth))
        yield Errors(errors.bad_pixel_rate, errors.end_point_error, gradients.gradient_error)


def stages_of(frames: Sequence[EvaluationFrame]) -> tuple[Sequence[EvaluationFrame], ...]:
    """A quarter of the frames, another quarter, and the rest, each spread evenly; all at once where they are few.

    Examples:
        >>> stages_of(range(10))
        (range(0, 10, 4), range(2, 10, 4), range(1, 10, 2))
    """
    if len(frames) < FEWEST_STAGED:
        return (frames,)
    return frames[::4], frames[2::4], frames[1::2]


class Race:
    """The objective of a method's settings on frames, against the best so far.

    Args:
        frames: What they are measured on.
        initial: Errors of the initial disparity after each stage of the frames.
        objective: Which of the errors.
    """

    def __init__(
        self, frames: Sequence[EvaluationFrame], initial: Sequence[Errors], objective: Objective
    ) -> None:
        self.stages, self.initial, self.objective = stages_of(frames), initial, objective
        self.best: list[float] = []
        """The best setting's objective after each stage."""

    def __call__(self, method: Method) -> float:
        """The objective of a setting; infinite where it is given up."""
        found: list[float] = []
        for errors, initial in zip(measure_in_stages(method, self.stages), self.initial, strict=True):
            found.append(objective_of(errors, initial, self.objective))
            measured = len(found) == len(self.stages)
            if not measured and self.best and found[-1] > (1 + CLEARLY_BEHIND) * self.best[len(found) - 1]:
                return math.inf
        if not self.best or found[-1] < self.best[-1]:
            self.best = found
        return found[-1]

    def against(self, method: Method) -> None:
        """Race against a setting whose objective is known, but not after each stage."""
        if len(self.stages) > 1:
            self(method)


def objective_of(errors: Errors, initial: Errors, objective: Objective) -> float:
    """Errors relative to those of the initial disparity; infinite where a ratio is not defined."""
    ratios = {
        name: getattr(errors, name) / getattr(initial, name) if getattr(initial, name) > 0 else math.inf
        for name in ("bad", "epe", "gradient")
    }
    value = sum(ratios.values()) / 3 if objective == "balanced" else ratios[objective]
    return value if math.isfinite(value) else math.inf


def tune_method(
    kind: type[Method],
    evaluate: Callable[[Method], float],
    known: Sequence[Trial] = (),
    on_trial: Callable[[Trial], None] | None = None,
) -> TunedMethod:
    """Search a method's parameters, until a round over them gains next to nothing.

    Defaults whose objective is not finite are the only trial: there is nothing to compare others with.

    Args:
        kind: The method; its `search` may be empty, and then its defaults are tried only.
        evaluate: The objective of a setting, which is minimised.
        known: Trials of an earlier search with the same `evaluate`, which are not repeated.
        on_trial: Called after each new trial.
    """
    search = _Search(kind, evaluate, {_key(trial.setting): trial for trial in known}, on_trial)
    best = search.trial(kind())
    for _ in range(ROUNDS if math.isfinite(best[0]) else 0):
        before = best[0]
        for paths in (*((path,) for path in kind.search), *kind.tied):
            best = search.along(paths, best)
        if before - best[0] < LEAST_GAIN:
            break
    return TunedMethod.best_of(kind, tuple(search.trials.values()))


class _Search:
    """The trials of one search, each made once."""

    def __init__(
        self,
        kind: type[Method],
        evaluate: Callable[[Method], float],
        known: dict[str, Trial],
        on_trial: Callable[[Trial], None] | None,
    ) -> None:
        self.kind, self.evaluate, self.known, self.on_trial = kind, evaluate, known, on_trial
        self.trials: dict[str, Trial] = {}

    def trial(self, method: Method) -> tuple[float, Method]:
        setting = {path: value_at(method, path) for path in self.kind.search}
        key = _key(setting)
        if key not in self.trials:
            trial = self.known.get(key)
            if trial is None:
                trial = Trial(setting, self.evaluate(method))
                if self.on_trial is not None:
                    self.on_trial(trial)
            self.trials[key] = trial
        return self.trials[key].objective, method

    def along(self, paths: Sequence[str], best: tuple[float, Method]) -> tuple[float, Method]:
        """Move along the values of one parameter, or of several at once, while the objective falls: in the first
        direction in which it does."""
        began = best[0]
        for direction in product((1, -1), repeat=len(paths)):
            while (moved := self._moved(best[1], paths, direction)) is not None:
                tried = self.trial(moved)
                if tried[0] >= best[0]:
                    break
                best = tried
            if best[0] < began:
                break
        return best

    def _moved(self, method: Method, paths: Sequence[str], steps: Sequence[int]) -> Method | None:
        """The method with each of the parameters so many values further on; None beyond the last value of one."""
        for path, step in zip(paths, steps, strict=True):
            values = self.kind.search[path]
            index = values.index(value_at(method, path)) + step
            if not 0 <= index < len(values):
                return None
            method = with_value(method, path, values[index])
        return method


def value_at(record: Any, path: str) -> Any:
    """The value of a field of a dataclass, or of a dataclass in it: "parameters.alpha"."""
    for name in path.split("."):
        record = getattr(record, name)
    return record


def with_value(record: Any, path: str, value: Any) -> Any:
    """A copy of a dataclass with the value at a path (as `value_at`) replaced."""
    name, _, rest = path.partition(".")
    return replace(record, **{name: with_value(getattr(record, name), rest, value) if rest else value})


def usual_trials(kind: type[Method]) -> int:
    """About how many trials a search takes: the neighbours of every value, and half as many on the way."""
    return 1 + 3 * len(kind.search) + 4 * len(kind.tied)


def _key(setting: Mapping[str, Any]) -> str:
    return json.dumps(dict(setting), sort_keys=True)

"""Parameter search: predict the validation split once, then tune each method on it."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.sources.ground_truth import require_ground_truth
from datagen.sources.registry import DataSource
from refine.evaluation.evaluate import EvaluationFrame
from refine.evaluation.settings import Settings, read_settings, write_settings
from refine.evaluation.tuning import (
    Errors,
    Objective,
    Race,
    Trial,
    TunedMethod,
    measure_in_stages,
    stages_of,
    tune_method,
    usual_trials,
    value_at,
)
from refine.method import Method
from refine.registry import known_methods, table_order
from stereoforge.errors import CommandError
from stereoforge.pipelines.prediction import Predictors
from stereoforge.progress import console, progress_bar
from stereoforge_kit.viewing import duration

VALIDATION = "val"


@dataclass
class _Search:
    """The search of one method: first its defaults, which tell how long a trial takes, then all others."""

    kind: type[Method]
    race: Race
    trials: list[Trial]
    """Those that are known, which are not repeated."""
    remember: Callable[[Sequence[Trial]], None]
    """Called with all trials after each."""
    seconds: list[float] = field(default_factory=list)
    """What each new trial took; the first one may have waited for a compiler."""

    @property
    def trial_seconds(self) -> float:
        """What a trial takes; 0 where none was made."""
        counted = self.seconds[1:] or self.seconds
        return sum(counted) / len(counted) if counted else 0.0

    @property
    def trials_left(self) -> int:
        """About how many trials are still to be made."""
        return max(usual_trials(self.kind) - len(self.trials), 0)

    def begin(self, on_trial: Callable[[], None]) -> None:
        """Try the defaults, unless it is known what comes of them."""
        method = self.kind()
        setting = {path: value_at(method, path) for path in self.kind.search}
        if all(trial.setting != setting for trial in self.trials):
            self._note(Trial(setting, self._evaluate(method)))
            on_trial()

    def end(self, on_trial: Callable[[], None]) -> TunedMethod:
        """Try all that is left to try."""

        def note(trial: Trial) -> None:
            self._note(trial)
            on_trial()

        return tune_method(self.kind, self._evaluate, tuple(self.trials), note)

    def _note(self, trial: Trial) -> None:
        self.trials.append(trial)
        self.remember(self.trials)

    def _evaluate(self, method: Method) -> float:
        if self.trials and not self.race.best:  # resumed, and there is something left to try
            self.race.against(TunedMethod.best_of(self.kind, self.trials).method)
        began = time.perf_counter()
        value = self.race(method)
        self.seconds.append(time.perf_counter() - began)
        return value


def _time_left(searches: Sequence[_Search]) -> str:
    """About how long searches take, in words; nothing if they are at their end or it is not known yet."""
    if any(search.trials_left and not search.trial_seconds for search in searches):
        return ""
    seconds = sum(search.trials_left * search.trial_seconds for search in searches)
    return f"about {duration(seconds)}" if seconds else ""


@dataclass
class Tuning:
    """A running search. Every trial is on disk before the next one begins."""

    frames: Sequence[EvaluationFrame]
    out: Path
    about: dict[str, Any]
    objective: Objective = "balanced"
    tuned: dict[str, TunedMethod] = field(default_factory=dict)

    def run(self, names: tuple[str, ...] = ()) -> dict[str, TunedMethod]:
        """Tune the named methods, or all that have something to tune and whose inputs the frames have."""
        kinds = [known_methods()[name] for name in names or table_order()]
        kinds = [kind for kind in kinds if kind.search and not kind().missing(self.frames[0])]
        earlier = self._earlier()
        self.tuned = {
            name: TunedMethod(method, earlier.trials.get(name, ()))
            for name, method in earlier.methods.items()
        }
        initial = tuple(measure_in_stages(known_methods()["regressor"](), stages_of(self.frames)))
        searches = [self._search(kind, initial, earlier.trials.get(kind.name, ())) for kind in kinds]
        with progress_bar() as progress:
            bar = progress.add_task("tuning", total=sum(usual_trials(kind) for kind in kinds))
            for search in searches:
                progress.update(bar, description=f"tuning {search.kind.name}")
                search.begin(lambda: progress.advance(bar))
            if left := _time_left(searches):
                trials = sum(search.trials_left for search in searches)
                progress.console.print(
                    f"tuning {len(searches)} methods on {len(self.frames)} frames takes {left} for some {trials} trials"
                )
            done = 0
            for number, search in enumerate(searches, 1):
                progress.update(bar, description=f"tuning {search.kind.name}")
                self.tuned[search.kind.name] = result = search.end(lambda: progress.advance(bar))
                done += usual_trials(search.kind)
                progress.update(bar, completed=done)
                left = _time_left(searches[number:])
                progress.console.print(
                    f"{search.kind.name}: {result.default_objective:.3f} to {result.objective:.3f} in "
                    f"{len(result.trials)} trials" + (f"; {left} left" if left else "")
                )
        self._follow()
        write_settings(self.out, self.tuned, self.about)
        return self.tuned

    def _search(self, kind: type[Method], initial: Sequence[Errors], known: Sequence[Trial]) -> _Search:
        def remember(trials: Sequence[Trial]) -> None:
            self.tuned[kind.name] = TunedMethod.best_of(kind, trials)
            write_settings(self.out, self.tuned, {**self.about, "whole": False})

        return _Search(kind, Race(self.frames, initial, self.objective), list(known), remember)

    def _follow(self) -> None:
        """Give methods that hold another one its parameters."""
        for name, kind in known_methods().items():
            known = {path: other for path, other in kind.follows.items() if other in self.tuned}
            if known:
                held = {path: self.tuned[other].method for path, other in known.items()}
                self.tuned[name] = TunedMethod(replace(kind(), **held), ())

    def _earlier(self) -> Settings:
        """What an interrupted search of the same things has tried."""
        if not self.out.exists():
            return Settings()
        earlier = read_settings(self.out)
        if earlier.about.get("fingerprint") != self.about["fingerprint"]:
            console.print(f"{self.out}: was made on other frames or for another objective; it is replaced")
            return Settings()
        return earlier


def validation_frames(
    sources: Sequence[DataSource], predictors: Predictors, count: int
) -> list[EvaluationFrame]:
    """`count` frames with predictions, spread evenly over validation splits.

    Raises:
        CommandError: If a data set has no splits, and it is not said which part of it to validate on.
        DatasetError: If a data set has splits, but none for validation, or if no frame has ground truth.
    """
    for source in sources:
        if not (source.splits or source.sets_aside) and source.selection is None:
            raise CommandError(
                f"{source.location}: has no validation split, and parameters must not be chosen on what is tested; "
                f"say which frames to choose on, such as {source.location}#0-19"
            )
    samples = [sample for source in sources for sample in source.frames(VALIDATION)]
    chosen = np.unique(np.linspace(0, len(samples) - 1, min(count, len(samples))).round().astype(int))
    require_ground_truth(", ".join(source.location for source in sources), [samples[i] for i in chosen])
    with progress_bar() as progress:
        return [predictors.frame(samples[i]) for i in progress.track(chosen, description="predicting")]


def describe(
    frames: Sequence[EvaluationFrame],
    data: Sequence[str],
    objective: Objective,
    networks: Mapping[str, str],
) -> dict[str, Any]:
    """The circumstances of a search, as written to disk; the fingerprint tells whether two searches are the same.

    It covers the pictures, the ground truth and the networks (`prediction.network_digests`), not the predictions, which
    another number of threads rounds differently.
    """
    digest = hashlib.sha256(json.dumps([objective, dict(networks)], sort_keys=True).encode())
    for frame in frames:
        for values in (frame.image, frame.right, frame.truth):
            digest.update(b"-" if values is None else np.ascontiguousarray(values).tobytes())
    return {
        "data": list(data),
        "split": VALIDATION,
        "frames": [frame.name for frame in frames],
        "objective": objective,
        "fingerprint": digest.hexdigest(),
        "whole": True,
    }


def shown_values(method: Method) -> str:
    """The searched parameters of a method, for a table."""
    return ", ".join(f"{path.rpartition('.')[2]} {value_at(method, path)}" for path in type(method).search)

"""Parameter search: predict the validation split once, then tune each method on it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
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
    Trial,
    TunedMethod,
    measure,
    objective_of,
    tune_method,
    usual_trials,
    value_at,
)
from refine.method import Method
from refine.registry import known_methods, table_order
from stereoforge.errors import CommandError
from stereoforge.pipelines.prediction import Predictors
from stereoforge.progress import console, progress_bar

VALIDATION = "val"


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
        initial = measure(known_methods()["regressor"](), self.frames)
        with progress_bar() as progress:
            bar = progress.add_task("tuning", total=sum(usual_trials(kind) for kind in kinds))
            done = 0
            for kind in kinds:
                progress.update(bar, description=f"tuning {kind.name}")
                self._tune(kind, initial, earlier.trials.get(kind.name, ()), lambda: progress.advance(bar))
                done += usual_trials(kind)
                progress.update(bar, completed=done)
        self._follow()
        write_settings(self.out, self.tuned, self.about)
        return self.tuned

    def _tune(self, kind: type[Method], initial: Errors, known: Sequence[Trial], step: Any) -> None:
        tried = list(known)

        def remember(trial: Trial) -> None:
            tried.append(trial)
            so_far = {**self.tuned, kind.name: TunedMethod.best_of(kind, tried)}
            write_settings(self.out, so_far, {**self.about, "whole": False})
            step()

        def evaluate(method: Method) -> float:
            return objective_of(measure(method, self.frames), initial, self.objective)

        self.tuned[kind.name] = tune_method(kind, evaluate, known, remember)

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
            console.print(
                f"{self.out}: was made on other frames or for another objective; it is replaced", markup=False
            )
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
        if not source.format.splits and source.selection is None:
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

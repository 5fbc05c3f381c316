"""The search on objectives whose minimum is known, and the file it leaves."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import pytest

from refine.baselines.wmf import WMF
from refine.energy.parameters import MRFParameters
from refine.evaluation.settings import read_settings, write_settings
from refine.evaluation.tuning import (
    Errors,
    Trial,
    TunedMethod,
    measure,
    objective_of,
    tune_method,
    with_value,
)
from refine.method import EvaluationFrame, Method, MethodOutput
from refine.methods.ours import Ours
from refine.methods.ours_conf_gt import OursConfGT
from refine.registry import default_methods
from tests.refine.worlds import toy_frame


@dataclass(frozen=True)
class Inner:
    a: float = 3.0


@dataclass(frozen=True)
class Valley(Method):
    """A method whose objective is |a - 5| + |b - 2| + a quarter of |a - b|, whatever the frame."""

    name: ClassVar[str] = "valley"
    label: ClassVar[str] = "Valley"
    search: ClassVar = {"inner.a": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), "b": (0, 1, 2, 3, 4, 5)}

    inner: Inner = field(default_factory=Inner)
    b: int = 4

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        return MethodOutput(frame.disparity)

    @property
    def objective(self) -> float:
        return abs(self.inner.a - 5) + abs(self.b - 2) + abs(self.inner.a - self.b) / 4


def test_the_search_walks_to_the_minimum_and_tries_nothing_twice():
    seen: list[tuple[float, int]] = []
    told: list[Trial] = []

    def evaluate(method: Valley) -> float:
        seen.append((method.inner.a, method.b))
        return method.objective

    found = tune_method(Valley, evaluate, on_trial=told.append)
    assert found.method == Valley(Inner(5.0), 2)
    assert found.objective == found.method.objective
    assert found.default_objective == Valley().objective
    assert len(seen) == len(set(seen)) < 36
    assert list(found.trials) == told


def test_a_search_ends_where_there_is_nothing_to_compare_or_to_gain():
    seen: list[Valley] = []
    tune_method(Valley, lambda method: seen.append(method) or float("inf"))
    assert seen == [Valley()]
    seen.clear()
    tune_method(Valley, lambda method: seen.append(method) or 1.0)
    assert len(seen) == 1 + 2 * len(Valley.search)


@dataclass(frozen=True)
class Diagonal(Valley):
    """Its valley runs aslant, so that each round gets a step further; eight of them to the end."""

    search: ClassVar = {"inner.a": tuple(float(i) for i in range(9)), "b": tuple(range(9))}
    inner: Inner = field(default_factory=lambda: Inner(8.0))
    b: int = 8

    @property
    def objective(self) -> float:
        return self.inner.a + self.b + 2 * abs(self.inner.a - self.b + 0.5)


def test_the_search_goes_round_until_it_is_at_the_end():
    assert tune_method(Diagonal, lambda method: method.objective).method == Diagonal(Inner(0.0), 0)


@dataclass(frozen=True)
class Canyon(Diagonal):
    """Its slopes are too steep for one parameter alone."""

    tied: ClassVar = (("inner.a", "b"),)

    @property
    def objective(self) -> float:
        return self.inner.a + self.b + 9 * abs(self.inner.a - self.b)


def test_parameters_that_make_up_for_one_another_are_moved_together():
    assert tune_method(Canyon, lambda method: method.objective).method == Canyon(Inner(0.0), 0)


def test_a_search_goes_on_from_earlier_trials():
    whole = tune_method(Valley, lambda method: method.objective)
    fresh: list[Trial] = []
    again = tune_method(Valley, lambda method: method.objective, whole.trials[:4], fresh.append)
    assert again == whole
    assert fresh == list(whole.trials[4:])


def test_measures_are_those_of_the_tables():
    frames = [toy_frame(seed, 20, 30) for seed in (0, 1)]
    errors = measure(WMF(radius_px=3), frames)
    from refine.evaluation.evaluate import evaluate

    score = evaluate(frames, [WMF(radius_px=3)]).scores["wmf"]
    assert errors == Errors(score.regions["all"].bad, score.regions["all"].epe, score.gradient_masked)
    initial = Errors(0.5, 2.0, 1.0)
    assert objective_of(Errors(0.25, 1.0, 0.25), initial, "balanced") == pytest.approx((0.5 + 0.5 + 0.25) / 3)
    assert objective_of(Errors(0.25, 1.0, 0.25), initial, "gradient") == 0.25
    assert objective_of(Errors(float("nan"), 1.0, 0.25), initial, "balanced") == float("inf")
    with pytest.raises(ValueError, match="gradnet gives no disparity"):
        measure(default_methods(("gradnet",))[0], frames)


def test_ours_is_tuned_to_its_frames():
    frames = [toy_frame(seed, 24, 40) for seed in (0, 1)]
    frames = [replace(frame, confidence=frame.confidence.clip(0, 1)) for frame in frames]
    initial = measure(default_methods(("regressor",))[0], frames)
    found = tune_method(Ours, lambda method: objective_of(measure(method, frames), initial, "balanced"))
    assert found.objective < found.default_objective
    assert found.objective == objective_of(measure(found.method, frames), initial, "balanced")


def tuned_methods() -> dict[str, TunedMethod]:
    ours = Ours(MRFParameters(alpha=30.0))
    trials = (Trial({"parameters.alpha": 100.0}, 0.9), Trial({"parameters.alpha": 30.0}, float("inf")))
    return {
        "ours": TunedMethod(ours, trials),
        "ours_conf_gt": TunedMethod(OursConfGT(mrf=ours), ()),
        "wmf": TunedMethod(WMF(radius_px=3), ()),
    }


def test_the_file_gives_back_what_was_written(tmp_path):
    path = tmp_path / "new" / "parameters.json"
    write_settings(path, tuned_methods(), {"frames": ["a"]})
    settings = read_settings(path)
    assert settings.methods == {name: tuned.method for name, tuned in tuned_methods().items()}
    assert settings.trials["ours"] == tuned_methods()["ours"].trials
    assert settings.about == {"frames": ["a"]}
    assert [row.name for row in settings.rows(("wmf", "regressor"))] == ["wmf", "regressor"]
    assert settings.rows(("wmf",)) == (WMF(radius_px=3),)
    assert [row.name for row in settings.rows()] == [row.name for row in default_methods()]


@pytest.mark.parametrize(
    ("path", "value", "reason"),
    [
        (("format",), 9, "has format 9"),
        (("methods", "magic"), {}, "no method 'magic'"),
        (("methods", "wmf", "radius_px"), "wide", "radius_px"),
        (("methods", "wmf", "depth"), 3, "depth"),
        (("methods", "wmf", "sigma"), -1, "wmf|positive sigma"),
        (("methods", "ours", "parameters"), [1], "ours"),
        (("trials", "ours"), [{}], "setting|objective"),
        (("methods",), [], "whole"),
    ],
)
def test_a_file_that_sets_nonsense_is_refused(tmp_path, path, value, reason):
    file = tmp_path / "parameters.json"
    write_settings(file, tuned_methods(), {})
    document = json.loads(file.read_text())
    place = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    file.write_text(json.dumps(document))
    with pytest.raises(ValueError, match=reason) as caught:
        read_settings(file)
    assert str(file) in str(caught.value)


def test_files_that_are_none_are_refused(tmp_path):
    file = tmp_path / "parameters.json"
    for content in ("", "{", "[]", '{"format": 1}'):
        file.write_text(content)
        with pytest.raises(ValueError, match=r"parameters\.json"):
            read_settings(file)
    with pytest.raises(ValueError, match="cannot be read"):
        read_settings(tmp_path / "missing.json")


def test_with_value_reaches_into_records():
    changed = with_value(Ours(), "parameters.alpha", 7.0)
    assert changed.parameters == MRFParameters(alpha=7.0)
    assert replace(changed, parameters=MRFParameters()) == Ours()
    assert np.isclose(Ours().parameters.alpha, 100)

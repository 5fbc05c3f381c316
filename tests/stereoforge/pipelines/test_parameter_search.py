"""A search over frames: resumed where it was interrupted, and never on a test split."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import refine.evaluation.tuning as tuning
from datagen import DatasetError
from datagen.sources.registry import DataSource, SourceFormat
from refine.evaluation.settings import read_settings
from refine.evaluation.tuning import Race
from refine.methods.ours import Ours
from stereoforge.errors import CommandError
from stereoforge.pipelines.parameter_search import Tuning, describe, validation_frames
from stereoforge.pipelines.prediction import network_digests
from tests.refine.worlds import toy_frame


def frames_with_networks():
    frames = [toy_frame(seed, 20, 30) for seed in (0, 1)]
    return [replace(frame, confidence=frame.confidence.clip(0, 1)) for frame in frames]


def search(out: Path, frames=None, networks: str = "trained") -> Tuning:
    frames = frames or frames_with_networks()
    return Tuning(frames, out, describe(frames, ["data"], "balanced", {"regressor": networks}))


def test_an_interrupted_search_ends_as_an_uninterrupted_one(tmp_path, monkeypatch):
    names = ("wmf", "grad", "ours")
    whole = search(tmp_path / "whole.json").run(names)
    assert whole["ours_conf_gt"].method.mrf == whole["ours"].method

    trial, calls = Race.__call__, 0

    def interrupted(race, method):
        nonlocal calls
        calls += 1
        if calls == 13:
            raise KeyboardInterrupt
        return trial(race, method)

    monkeypatch.setattr(Race, "__call__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        search(tmp_path / "part.json").run(names)
    part = read_settings(tmp_path / "part.json")
    assert part.about["whole"] is False
    assert sum(map(len, part.trials.values())) == 12
    search(tmp_path / "part.json").run(names)
    assert (tmp_path / "part.json").read_bytes() == (tmp_path / "whole.json").read_bytes()
    trials = sum(len(result.trials) for result in whole.values())
    assert calls == trials + 1  # one trial was interrupted, and none made twice


def test_another_set_of_frames_starts_anew_and_another_method_joins(tmp_path):
    out = tmp_path / "parameters.json"
    search(out).run(("wmf",))
    search(out).run(("grad",))
    assert set(read_settings(out).methods) == {"wmf", "grad"}
    search(out, frames_with_networks()[:1]).run(("grad",))
    assert set(read_settings(out).methods) == {"grad"}


def test_a_search_is_known_by_its_networks_not_by_how_their_predictions_are_rounded(tmp_path):
    """Another number of threads rounds otherwise, and must not throw away what was found."""
    out = tmp_path / "parameters.json"
    search(out).run(("wmf",))
    frames = [replace(f, disparity=np.nextafter(f.disparity, np.float32(99))) for f in frames_with_networks()]
    search(out, frames).run(("grad",))
    assert set(read_settings(out).methods) == {"wmf", "grad"}
    search(out, networks="trained further").run(("grad",))
    assert set(read_settings(out).methods) == {"grad"}


def test_networks_are_told_apart_by_their_weights(tmp_path):
    for task in ("regressor", "gradnet_free"):
        (tmp_path / f"{task}.safetensors").write_bytes(task.encode())
        (tmp_path / f"{task}.json").write_text("{}")
    before = network_digests(tmp_path)
    assert before.keys() == {"regressor"}
    assert network_digests(tmp_path, "sgbm").keys() == {"gradnet_free"}
    (tmp_path / "regressor.safetensors").write_bytes(b"others")
    assert network_digests(tmp_path) != before


def test_methods_without_inputs_or_parameters_are_left_out(tmp_path):
    frames = [replace(frame, gradient=None, confidence=None) for frame in frames_with_networks()]
    assert set(search(tmp_path / "p.json", frames).run()) == {"wmf"}


def test_a_set_without_a_validation_split_is_refused():
    """One that belongs to every split at once needs its frames named; one with splits needs a `val` among them."""
    sample = SimpleNamespace(disparity_left=np.ones((2, 3), np.float32))
    unsplit = SourceFormat("flat", "a flat set", lambda _: True, lambda *_: [sample] * 3)
    with pytest.raises(CommandError, match=r"sets/flat: has no validation split.*sets/flat#0-19"):
        validation_frames([DataSource(unsplit, "sets/flat")], None, 5)
    tested = SourceFormat(
        "split", "a split set", lambda _: True, lambda *_: [SimpleNamespace()], ("train", "test")
    )
    with pytest.raises(DatasetError, match="no split 'val'"):
        validation_frames([DataSource(tested, "sets/split")], None, 5)
    chosen = validation_frames(
        [DataSource(unsplit, "sets/flat", (0, 1))], SimpleNamespace(frame=lambda _: "frame"), 5
    )
    assert chosen == ["frame", "frame"]


def test_a_search_says_how_long_it_takes_before_it_does_and_what_is_left(tmp_path, capsys):
    names = ("wmf", "grad", "ours")
    found = search(tmp_path / "parameters.json").run(names)
    first, *lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"tuning 3 methods on 2 frames takes about \d+ \w+ for some \d+ trials", first)
    methods = [name for name in found if name in names]
    for name, line, last in zip(methods, lines, (False, False, True), strict=True):
        trials = len(found[name].trials)
        assert re.fullmatch(rf"{name}: \d\.\d+ to \d\.\d+ in {trials} trials(; about \d+ \w+ left)?", line)
        assert (not last) == line.endswith(" left")


def test_a_search_in_stages_ends_near_one_that_gives_nothing_up(tmp_path, monkeypatch):
    """And is interrupted and resumed like any other."""
    frames = [toy_frame(seed, 32, 48) for seed in range(9)]
    frames = [replace(frame, confidence=frame.confidence.clip(0, 1)) for frame in frames]
    runs, run = 0, Ours.run

    def counted(method, frame):
        nonlocal runs
        runs += 1
        return run(method, frame)

    monkeypatch.setattr(Ours, "run", counted)
    staged = search(tmp_path / "staged.json", frames).run(("ours",))["ours"]
    staged_runs, runs = runs, 0
    assert any(trial.objective == float("inf") for trial in staged.trials)
    monkeypatch.setattr(Ours, "run", run)

    text = (tmp_path / "staged.json").read_bytes()
    document = json.loads(text)
    document["trials"]["ours"] = document["trials"]["ours"][:9]
    (tmp_path / "part.json").write_text(json.dumps(document))
    search(tmp_path / "part.json", frames).run(("ours",))
    assert (tmp_path / "part.json").read_bytes() == text

    monkeypatch.setattr(Ours, "run", counted)
    monkeypatch.setattr(tuning, "CLEARLY_BEHIND", float("inf"))
    whole = search(tmp_path / "whole.json", frames).run(("ours",))["ours"]
    assert staged.objective < 1.1 * whole.objective < 0.1 * whole.default_objective
    assert staged_runs < 0.9 * runs

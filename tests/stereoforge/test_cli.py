"""The command line as a user meets it: help, every stage on a tiny set, and one sentence for every mistake."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
import torch

from datagen import StereoDataset
from datagen.formats import read_pfm
from refine.evaluation.settings import read_settings
from refine.evaluation.tuning import measure
from refine.registry import known_methods
from stereoforge.bundled_weights import BUNDLED_WEIGHTS
from stereoforge.cli import main
from stereoforge.commands import COMMANDS, command_class, command_summary
from stereoforge.errors import UsageError
from stereoforge.pipelines.demo import DemoPlan, DemoResult, run_demo
from stereoforge.pipelines.prediction import open_predictors
from stereoforge_kit.errors import InputError

RenderTiny = ["render", "--scenes", "1", "--size", "64x36", "--samples", "1", "--workers", "1"]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, DemoResult]:
    """The demo with next to no scenes and steps: every stage is the real one."""
    plan = DemoPlan(
        scenes={"train": 2, "val": 1, "test": 1},
        steps={"regressor": 3, "confnet": 2, "gradnet": 2},
    )
    small = DemoPlan(type(plan.world)(width=384, height=192), plan.scenes, plan.steps, gallery_scenes=2)
    out = tmp_path_factory.mktemp("demo") / "demo"
    return out, run_demo(out, small)


def run(*arguments: str | Path) -> int:
    """The exit code of a command."""
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Runs a command that must fail with one sentence; returns the sentence."""

    def call(code: int, *arguments: str | Path) -> str:
        assert run(*arguments) == code
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1, lines
        assert lines[0].startswith("stereoforge: ")
        return lines[0]

    return call


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_every_command_has_help_with_defaults(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(command, "--help") == 0
    text = capsys.readouterr().out
    assert f"stereoforge {command}" in text
    assert "--" in text


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (InputError("views.png: is empty"), 1, "stereoforge: views.png: is empty"),
        (UsageError("--size takes WxH"), 2, "stereoforge: --size takes WxH"),
        (
            ValueError("shapes (2,) (3,)"),
            1,
            "stereoforge: unexpected ValueError: shapes (2,) (3,) (run again with --debug to see where)",
        ),
    ],
)
def test_only_errors_for_people_are_shown_as_they_are(
    error: Exception,
    code: int,
    sentence: str,
    monkeypatch: pytest.MonkeyPatch,
    refused: Callable[..., str],
) -> None:
    """A library's bare ValueError is a fault of the program, and says how to see where."""

    def fail(_: object) -> None:
        raise error

    monkeypatch.setattr(command_class("view"), "run", fail)
    assert refused(code, "view", "set", "--out", "page.html") == sentence


def test_the_module_and_the_script_are_one_program() -> None:
    done = subprocess.run([sys.executable, "-m", "stereoforge", "--help"], capture_output=True, text=True)
    assert done.returncode == 0
    assert set(COMMANDS) <= set(done.stdout.replace(",", " ").split()) | {"verify"}


def test_the_list_of_commands_imports_none_of_them() -> None:
    ask = "import sys; from stereoforge.cli import main\ntry: main(['--help'])\nfinally: print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True)
    assert done.returncode == 0
    *_, modules = done.stdout.strip().splitlines()
    assert not {"numpy", "torch", "bpy", "stereoforge.commands.render"} & set(modules.split())
    for name in COMMANDS:
        summary = command_summary(name)
        assert summary
        assert (command_class(name).__doc__ or "").startswith(summary)


@pytest.mark.parametrize(
    ("program", "heavy"),
    [
        ("from stereoforge.commands import refine", {"torch", "matplotlib", "numba", "trimesh", "bpy"}),
        ("from stereoforge.commands import render", {"torch", "matplotlib", "bpy"}),
        (
            "from training.prediction.predictor import StereoPredictor\n"
            "from stereoforge.bundled_weights import BUNDLED_WEIGHTS\n"
            "StereoPredictor(BUNDLED_WEIGHTS)",
            {"torch._dynamo", "bpy", "pytorch_lightning", "matplotlib"},
        ),
    ],
    ids=["refine", "render", "networks"],
)
def test_what_takes_long_to_import_waits_until_it_is_needed(program: str, heavy: set[str]) -> None:
    ask = f"{program}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert not heavy & set(done.stdout.split())


def test_the_version_is_told() -> None:
    done = subprocess.run([sys.executable, "-m", "stereoforge", "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, f"stereoforge {version('stereoforge')}\n")


@pytest.mark.parametrize("command", ["--help", "render"])
def test_an_interruption_while_it_starts_is_no_traceback(command: str, tmp_path: Path) -> None:
    """Imports take seconds, and are interrupted where `tyro` is asked for first."""
    (tmp_path / "tyro.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    done = subprocess.run(
        [sys.executable, "-m", "stereoforge", command],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path.cwd())])},
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.default_int_handler),
    )
    assert done.returncode == 130
    assert len(done.stderr.strip().splitlines()) == 1
    assert "interrupted" in done.stderr


def test_wrong_flags_exit_with_2(tmp_path: Path, refused: Callable[..., str]) -> None:
    refusals = (
        ("--samples", "many", "--samples takes a whole number, not 'many'"),
        ("--seed", "1e9", "--seed takes a whole number, not '1e9'"),
        ("--scene-timeout", "long", "--scene-timeout takes a number, not 'long'"),
        ("--split", "dev", "Expected one of test, train, val."),
        ("--frames-per-scene", "0", "--frames-per-scene must be at least 1"),
        ("--shard", "x", "I/N"),
        ("--curriculum", "-2", "must not be negative"),
        ("--size", "99999x99999", "too large"),
        ("--disparity-range", "2,2000", "never seen in images that are 960 px wide"),
        ("--disparity-histogram", "2-2000:1", "never seen in images that are 960 px wide"),
    )
    for flag, value, sentence in refusals:
        assert sentence in refused(2, "render", "--out", tmp_path / "set", flag, value)
    assert "--only-failed" in refused(2, "render", "--out", tmp_path / "set", "--dry-run", "--only-failed")
    assert "--out needs a folder" in refused(2, "render", "--out", "")
    assert "meant --samples?" in refused(2, "render", "--out", tmp_path / "set", "--sampels", "4")
    assert "Missing from stereoforge render: --out DIR" in refused(2, "render")
    assert "evaluate" in refused(2, "paint")
    assert "WIDTHxHEIGHT" in refused(2, "render", "--out", tmp_path / "set", "--size", "big")
    assert "at least 1" in refused(2, "render", "--out", tmp_path / "set", "--samples", "0")
    assert "no --family swimming" in refused(2, "render", "--out", tmp_path / "set", "--family", "swimming")
    assert "I/N" in refused(2, "render", "--out", tmp_path / "set", "--shard", "4/4")
    drafts = ("render", "--out", tmp_path / "set", "--engine", "workbench")
    assert "--device is for the engine cycles" in refused(2, *drafts, "--device", "cuda")
    assert "--samples is for the engine cycles" in refused(2, *drafts, "--samples", "4")
    assert "final pass needs the engine cycles" in refused(2, *drafts, "--passes", "clean,final")
    for histogram in ("many", "2-20:1,30-60:1", "20-2:1", "2-20:0"):
        asked = ("--disparity-histogram", histogram)
        assert "disparity" in refused(2, "render", "--out", tmp_path / "set", *asked)
    assert not (tmp_path / "set").exists()


def test_the_bundled_parameters_are_not_overwritten(refused: Callable[..., str]) -> None:
    for weights in ("paper", str(BUNDLED_WEIGHTS)):
        assert "name a file for the parameters with --out" in refused(2, "tune", "set", "--weights", weights)


def test_wrong_training_flags_exit_with_2(tmp_path: Path, refused: Callable[..., str]) -> None:
    """Before any data is looked for."""
    command = ("train", "confnet", "--data", tmp_path / "none", "--out", tmp_path / "run")
    for flag, value, sentence in (
        ("--steps", "0", "--steps must be at least 1, got 0"),
        ("--batch-size", "0", "--batch-size must be at least 1, got 0"),
        ("--learning-rate", "nan", "--learning-rate must be positive, got nan"),
        ("--freeze", "look", "--freeze is for regressor and regressor_f, not for confnet"),
        ("--curriculum", "1.5", "--curriculum must be a share from 0 to 1, got 1.5"),
        ("--curriculum", "nan", "--curriculum must be a share from 0 to 1, got nan"),
        ("--ema", "1", "--ema must lie between 0 and 1"),
        ("--correct-within", "-1", "--correct-within must be positive"),
        ("--crop", "big", "WIDTHxHEIGHT"),
    ):
        assert sentence in refused(2, *command, flag, value)
    forest = ("train", "rdf", "--data", tmp_path / "none", "--out", tmp_path / "run")
    assert "--curriculum is for networks" in refused(2, *forest, "--curriculum", "0.5")
    assert "--correct-within is for networks" in refused(2, *forest, "--correct-within", "3")
    assert not (tmp_path / "run").exists()


def test_no_data_and_wrong_folders_are_sentences(tmp_path: Path, refused: Callable[..., str]) -> None:
    missing, empty = tmp_path / "missing", tmp_path / "empty"
    empty.mkdir()
    (empty / "note.txt").write_text("not a data set")
    for folder in (missing, empty):
        for command in (
            ("verify", folder),
            ("view", folder, "--out", tmp_path / "page.html"),
            ("train", "regressor", "--data", folder, "--out", tmp_path / "run"),
            ("evaluate", folder, "--weights", tmp_path / "run", "--out", tmp_path / "report"),
        ):
            assert str(folder) in refused(1, *command)
    assert "neither empty nor a data set" in refused(1, *RenderTiny, "--out", empty)
    assert "is a folder" in refused(2, "view", missing, "--out", empty)
    assert "--scenes takes a whole number" in refused(2, "view", missing, "--out", empty, "--scenes", "x")
    assert "--scenes must be at least 1" in refused(2, "view", missing, "--out", empty, "--scenes", "0")
    assert "is a file, not a folder" in refused(1, *RenderTiny, "--out", empty / "note.txt")
    assert not (tmp_path / "page.html").exists()


@pytest.mark.slow
def test_the_demo_leaves_what_it_promises(demo: tuple[Path, DemoResult]) -> None:
    out, result = demo
    numbers = json.loads((out / "report" / "results.json").read_text())
    assert set(numbers["sets"][0]["methods"]) == set(known_methods()) - {"regressor_f"}
    assert all(row["seconds"] > 0 for row in numbers["sets"][0]["methods"].values())
    for page in (result.report, result.gallery):
        text = page.read_text()
        assert "<html" in text
        assert "https://" not in text.replace("https://www.w3.org", "")
    assert all(
        (result.weights / f"{name}.safetensors").is_file() for name in ("regressor", "confnet", "gradnet")
    )
    assert result.evaluation.scores["ours"].regions["all"].epe > 0
    assert set(numbers["sets"][1]["methods"]) == {"regressor", "gradnet", "ours", "ours_conf_gt"}
    bundled, own = (
        each.scores["regressor"].regions["all"].epe for each in (result.bundled, result.evaluation)
    )
    assert bundled < own  # three steps of training against hours


@pytest.mark.slow
def test_the_bundled_weights_refine_a_pair(demo: tuple[Path, DemoResult], tmp_path: Path) -> None:
    out, _ = demo
    pair = [next(out.glob(f"data/frames_cleanpass/TEST/A/0000/{eye}/*.png")) for eye in ("left", "right")]
    assert run("refine", *pair, "--out", tmp_path / "r") == 0
    truth = read_pfm(next(out.glob("data/disparity/TEST/A/0000/left/*.pfm")))
    refined = read_pfm(tmp_path / "r" / "disparity.pfm")
    assert np.abs(refined - truth).mean() < 0.5 * np.abs(truth - np.median(truth)).mean()


@pytest.mark.slow
def test_the_demo_continues_what_is_there(demo: tuple[Path, DemoResult]) -> None:
    out, _ = demo
    files = [*out.glob("weights/*.safetensors"), *out.glob("data/manifest/*/*/*.json")]
    before = {path: path.read_bytes() for path in files}
    plan = DemoPlan(
        type(DemoPlan().world)(width=384, height=192),
        {"train": 2, "val": 1, "test": 1},
        {"regressor": 3, "confnet": 2, "gradnet": 2},
        gallery_scenes=2,
    )
    run_demo(out, plan)
    assert {path: path.read_bytes() for path in files} == before


@pytest.mark.slow
def test_refine_writes_what_it_promises(demo: tuple[Path, DemoResult], tmp_path: Path) -> None:
    out, _ = demo
    pair = [next(out.glob(f"data/frames_cleanpass/TEST/A/0000/{eye}/*.png")) for eye in ("left", "right")]
    assert run("refine", *pair, "--weights", out / "weights", "--out", tmp_path / "r") == 0
    names = {path.name for path in (tmp_path / "r").iterdir()}
    assert names >= {
        "disparity.pfm",
        "disparity_initial.pfm",
        "confidence.pfm",
        "gradient.exr",
        "overview.png",
    }
    refined = read_pfm(tmp_path / "r" / "disparity.pfm")
    assert refined.shape == (192, 384)
    assert np.isfinite(refined).all()
    # The demo tunes nothing: by default it is the paper's MRF, with the paper's parameters.
    tuned = tmp_path / "parameters.json"
    methods = {"ours": {"gradient_scale": 0.1}, "ours_quadratic": {"parameters": {"alpha": 7.0}}}
    tuned.write_text(json.dumps({"format": 1, "about": {}, "methods": methods, "trials": {}}))
    results = {"untuned": refined}
    for name, words in (
        ("untuned exact", ("--form", "exact")),
        ("robust", ("--parameters", tuned, "--deviation")),
        ("exact", ("--parameters", tuned, "--form", "exact")),
        ("paper", ("--parameters", tuned, "--form", "paper", "--deviation")),
    ):
        assert run("refine", *pair, "--weights", out / "weights", "--out", tmp_path / name, *words) == 0
        results[name] = read_pfm(tmp_path / name / "disparity.pfm")
        assert np.isfinite(results[name]).all()
    np.testing.assert_array_equal(results.pop("untuned exact"), refined)
    for one, other in itertools.combinations(results.values(), 2):
        assert np.abs(one - other).max() > 0.1
    robust, quadratic = (read_pfm(tmp_path / name / "deviation.pfm") for name in ("robust", "paper"))
    assert (robust > 0).all()
    assert np.abs(robust - quadratic).max() > 0.1


@pytest.mark.slow
def test_refine_says_what_is_wrong_with_its_inputs(
    demo: tuple[Path, DemoResult], tmp_path: Path, refused: Callable[..., str]
) -> None:
    out, _ = demo
    left = next(out.glob("data/frames_cleanpass/TEST/A/0000/left/*.png"))
    broken, small = tmp_path / "broken.png", tmp_path / "small.png"
    broken.write_bytes(left.read_bytes()[:2000])
    iio.imwrite(small, np.zeros((30, 40, 3), np.uint8))
    common = ("--weights", out / "weights", "--out", tmp_path / "r")
    assert "broken.png" in refused(1, "refine", broken, left, *common)
    assert "missing.png" in refused(1, "refine", left, tmp_path / "missing.png", *common)
    assert "40x30" in refused(1, "refine", left, small, *common)
    weightless = ("--weights", tmp_path / "nothing", "--out", tmp_path / "r")
    assert "nothing" in refused(1, "refine", left, left, *weightless)
    assert "is a file, not a folder" in refused(2, "refine", left, left, "--out", small)
    part = tmp_path / "part"
    part.mkdir()
    for file in (out / "weights").glob("regressor.*"):
        shutil.copy(file, part)
    assert "no confnet" in refused(1, "refine", left, left, "--weights", part, "--out", tmp_path / "r")
    (part / "regressor.safetensors").write_bytes(b"\\x00" * 64)
    assert "regressor.safetensors" in refused(
        1, "refine", left, left, "--weights", part, "--out", tmp_path / "r"
    )
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
def test_tuned_parameters_are_evaluated_with(demo: tuple[Path, DemoResult], tmp_path: Path) -> None:
    out, _ = demo
    file, common = tmp_path / "parameters.json", (out / "data", "--weights", out / "weights")
    assert run("tune", *common, "--out", file, "--methods", "wmf,grad", "--frames", "1") == 0
    tuned = read_settings(file)
    assert set(tuned.methods) == {"wmf", "grad"}
    assert tuned.about["split"] == "val"
    assert all("VAL" in name for name in tuned.about["frames"])
    report = ("--out", tmp_path / "report", "--methods", "wmf", "--parameters", file)
    assert run("evaluate", *common, *report, "--split", "val") == 0
    got = json.loads((tmp_path / "report" / "results.json").read_text())["sets"][0]["methods"]["wmf"]
    frames = [open_predictors(out / "weights").frame(sample) for sample in StereoDataset(out / "data", "val")]
    assert got["epe_all"] == pytest.approx(measure(tuned.methods["wmf"], frames).epe)


def test_tune_refuses_the_test_split_and_unknown_methods(tmp_path: Path, refused: Callable[..., str]) -> None:
    common = ("tune", tmp_path, "--weights", tmp_path)
    assert "--split" in refused(2, *common, "--split", "test")
    assert "no method 'magic'" in refused(2, *common, "--methods", "magic")
    assert "--frames" in refused(2, *common, "--frames", "0")


@pytest.mark.slow
@pytest.mark.parametrize(
    "victim",
    [
        "frames_cleanpass/TEST/A/0000/right/0006.png",
        "disparity/TEST/A/0000/left/0006.pfm",
        "disparity_gradient/TEST/A/0000/left/0006.exr",
        "occlusion/TEST/A/0000/left/0006.png",
    ],
)
def test_damaged_files_are_named_wherever_they_are_read(
    demo: tuple[Path, DemoResult],
    tmp_path: Path,
    refused: Callable[..., str],
    victim: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out, _ = demo
    root = tmp_path / "data"
    shutil.copytree(out / "data", root)
    path = root / victim
    path.write_bytes(path.read_bytes()[:-300])
    assert run("verify", root) == 1
    assert victim in "".join(capsys.readouterr().out.split())
    if "gradient" not in victim:  # the evaluation derives gradients from the disparity
        sentence = refused(1, "evaluate", root, "--weights", out / "weights", "--out", tmp_path / "report")
        assert victim in sentence
        assert not (tmp_path / "report").exists()


INTERRUPTED = [
    (
        ("train", "regressor", "--data", "set", "--out", "run"),
        "training.runs.train.train",
        "there is no checkpoint yet: run again with --resume to start from step 0",
    ),
    (
        ("train", "rdf", "--data", "set", "--out", "run"),
        "stereoforge.pipelines.forest.train_forest",
        "nothing was written",
    ),
    (("demo",), "stereoforge.pipelines.demo.run_demo", "continues where it stopped"),
    (("study", "--plan", "p", "--out", "s"), "stereoforge.study.read_plan", "continues where it stopped"),
    (("evaluate", "set", "--out", "r"), "stereoforge.pipelines.set_evaluation.open_test_data", "starts anew"),
    (
        ("tune", "set", "--weights", "run"),
        "datagen.sources.registry.open_source",
        "continues where it stopped",
    ),
]


@pytest.mark.parametrize(("words", "busy_in", "how"), INTERRUPTED)
def test_sigterm_ends_every_command_with_how_to_go_on(
    words: tuple[str, ...],
    busy_in: str,
    how: str,
    refused: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = signal.getsignal(signal.SIGTERM)
    module, _, name = busy_in.rpartition(".")
    monkeypatch.setattr(import_module(module), name, lambda *_, **__: signal.raise_signal(signal.SIGTERM))
    sentence = refused(130, *words)
    assert sentence.startswith("stereoforge: interrupted; ")
    assert how in sentence
    assert signal.getsignal(signal.SIGTERM) == before


def test_an_interruption_within_a_compiled_function_is_one_too(
    refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numba turns it into a SystemError."""

    def compiled(*_: object, **__: object) -> None:
        raise SystemError("CPUDispatcher returned a result with an exception set") from KeyboardInterrupt()

    module, _, name = INTERRUPTED[0][1].rpartition(".")
    monkeypatch.setattr(import_module(module), name, compiled)
    assert refused(130, *INTERRUPTED[0][0]).startswith("stereoforge: interrupted; ")


def test_an_interrupted_training_names_the_step_it_goes_on_from(
    tmp_path: Path, refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    checkpoint = tmp_path / "logs" / "regressor" / "last.ckpt"
    checkpoint.parent.mkdir(parents=True)
    torch.save({"global_step": 24}, checkpoint)
    monkeypatch.setattr("training.runs.train.train", lambda *_: signal.raise_signal(signal.SIGTERM))
    words = ("train", "regressor", "--data", "set", "--out", tmp_path)
    assert refused(130, *words) == "stereoforge: interrupted; run again with --resume to go on from step 24"
    checkpoint.write_bytes(b"damaged")
    assert f"{checkpoint}: cannot be read, so the run cannot be resumed" in refused(130, *words)


def test_debug_shows_the_traceback(tmp_path: Path) -> None:
    with pytest.raises(Exception, match="missing"):
        main(["verify", str(tmp_path / "missing"), "--debug"])

"""The commands on a folder and on a list of a user's own."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from stereoforge.cli import main
from tests.training.synthetic import random_pair
from training.data.pipeline import open_sources
from training.errors import TrainingError

LINES = 10


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """left/, right/, disp/ and pairs.csv."""
    root = tmp_path_factory.mktemp("sets") / "mine"
    rows = ["left,right,disparity"]
    for i in range(LINES):
        pair = random_pair(np.random.default_rng(i), 64, 128)
        files = {"left/{}.png": pair.left, "right/{}.png": pair.right, "disp/{}.tiff": pair.disparity_left}
        for name, values in files.items():
            path = root / name.format(f"{i:03}")
            path.parent.mkdir(parents=True, exist_ok=True)
            assert cv2.imwrite(str(path), values[..., ::-1] if values.ndim == 3 else values)
        rows.append(",".join(name.format(f"{i:03}") for name in files))
    (root / "pairs.csv").write_text("\n".join(rows))
    return root


def command(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    said = capsys.readouterr()
    return int(end.value.code or 0), " ".join(said.out.split()), " ".join(said.err.split())


@pytest.mark.parametrize("source", ["folder:{}", "list:{}/pairs.csv"])
def test_evaluate(source: str, mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--predictor", "sgbm", "--methods", "wmf", "--out", tmp_path / "report")
    code, said, complaint = command(capsys, "evaluate", f"{source.format(mine)}#0-1", *words)
    assert (code, complaint) == (0, "")
    assert "left left/000.png, right right/000.png, disparit" in said
    assert "frames evaluated: 2 of" in said
    (evaluated,) = json.loads((tmp_path / "report" / "results.json").read_text())["sets"]
    assert evaluated["methods"]["wmf"]["epe_all"] < 20


def test_training_says_what_was_matched_and_what_validates(mine: Path) -> None:
    for source in (f"folder:{mine}", f"list:{mine / 'pairs.csv'}"):
        ((opened,), held_out) = open_sources([(source, 1.0)], (64, 128))
        assert len(opened.frames) == LINES - 1
        assert [frame.name.rpartition("/")[2] for frame in held_out] == ["009"]
        matched, validates = opened.remarks
        assert "10 pairs, " in matched
        assert validates.endswith("its last 1 of 10 frames are not trained on but validate")
        (_, named) = open_sources([(f"{source}#0-4", 1.0)], (64, 128), (f"{source}#5-9",))
        assert len(named) == 5
        ((scaled,), _) = open_sources([(f"{source},scale=2", 1.0)], (64, 128))
        assert scaled.fingerprint != opened.fingerprint
        np.testing.assert_array_equal(scaled.frames[0].disparity_left * 2, opened.frames[0].disparity_left)
    with pytest.raises(TrainingError, match="frames of 128x64 are smaller"):
        open_sources([(f"folder:{mine}", 1.0)], (128, 128))


@pytest.mark.slow
def test_train(mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said, told = command(
        capsys, "train", "regressor", "--data", f"folder:{mine}", "--out", tmp_path / "run", "--preset", "tiny",
        "--crop", "128x64", "--steps", "1", "--batch-size", "1",
    )  # fmt: skip
    assert code == 0
    assert "left left/000.png" in told
    assert "step 1 of 1; validation" in said


def test_what_is_wrong_ends_in_one_sentence_and_nothing_is_written(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "short.txt").write_text("a.png b.png\n")
    folder = tmp_path / "pairs"
    for view in ("left", "right"):
        (folder / view).mkdir(parents=True)
        cv2.imwrite(str(folder / view / "0.png"), np.zeros((4, 4, 3), np.uint8))
    out = ("--out", tmp_path / "out")
    for words, exit_code, reason in (
        (
            ("evaluate", f"folder:{folder}", *out),
            1,
            "has no frame with ground truth in the layout of a folder of",
        ),
        (("evaluate", f"list:{tmp_path / 'short.txt'}", *out), 1, r"short.txt: line 1 has 2 columns"),
        (("train", "regressor", "--data", f"list:{tmp_path / 'short.txt'}", *out), 1, "line 1 has 2 columns"),
        (("evaluate", f"list:{mine / 'pairs.csv'},scale=0", *out), 1, "scale= takes a positive number"),
        (("evaluate", f"folder:{mine},scale=2#0-99", *out), 1, "frames 0 to 99 were asked for, it has 10"),
        (("evaluate", f"folder:{mine},scale=2", "--out", mine / "report"), 2, "which is only read"),
        (("view", f"folder:{mine}", "--out", tmp_path / "a.html"), 1, "there is no such folder"),
        (
            ("train", "regressor", "--data", mine, "--disparity-scale", "2", *out),
            2,
            "goes with --pseudo-labels",
        ),
    ):
        code, _, complaint = command(capsys, *words)
        assert (code, reason in complaint) == (exit_code, True), complaint
        assert complaint.count("stereoforge: ") == 1
    assert not (tmp_path / "out").exists()

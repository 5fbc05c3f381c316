"""Commands look whether they can write before they work for hours."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from stereoforge.cli import main
from stereoforge.errors import UsageError
from stereoforge.places import check_writable
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import write_text


def test_a_check_leaves_nothing_behind(tmp_path: Path) -> None:
    check_writable("--out", tmp_path / "a/b/c")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "there").mkdir()
    (tmp_path / "there/file").write_text("mine")
    check_writable("--out", tmp_path / "there")
    check_writable("--out", tmp_path / "there/new")
    assert [path.name for path in (tmp_path / "there").iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("place", "says"),
    [("there/file", "is a file"), ("there/file/x", "is a file"), ("/proc/x/y", "cannot be written")],
)
def test_a_place_that_takes_no_files_is_refused(place: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there/file").write_text("mine")
    with pytest.raises(UsageError, match=f"--out .*{place}: {says}"):
        check_writable("--out", tmp_path / place)
    assert (tmp_path / "there/file").read_text() == "mine"


@pytest.mark.parametrize(
    "words",
    [
        ["evaluate", "set", "--out", "file"],
        ["evaluate", "set", "--out", "new", "--submission", "file/x"],
        ["refine", "left.png", "right.png", "--out", "file"],
        ["tune", "set", "--weights", "run", "--out", "file/parameters.json"],
        ["train", "regressor", "--data", "set", "--out", "file"],
        ["train", "rdf", "--data", "set", "--out", "file/run"],
        ["study", "--train", "driving", "--test", "monkaa", "--out", "file"],
        ["view", "set", "--out", "file/page.html"],
        ["demo", "--out", "file"],
        ["export-model", "run", "--out", "file"],
    ],
    ids=" ".join,
)
def test_every_command_asks_first(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An evaluation of hours ended in `File exists: file`, with nothing kept."""
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine")
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 2
    assert "is a file, not a folder, or lies in one" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_no_file_takes_the_place_of_a_pipe_or_a_device(tmp_path: Path) -> None:
    """As root `view --out /dev/null` put a page in the place of the device."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is a device or a pipe"):
        write_text(tmp_path / "pipe", "text")
    assert (tmp_path / "pipe").is_fifo()
    assert [path.name for path in tmp_path.iterdir()] == ["pipe"]

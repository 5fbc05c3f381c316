"""Temporary files where nothing but --out can be written."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from stereoforge.temporary_files import temporary_files_in_out


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A system without a folder for temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", lambda: [str(tmp_path / "nowhere")])
    for name in ("TMPDIR", "TMP", "TEMP", "MPLCONFIGDIR", "NUMBA_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.usefixtures("nowhere")
@pytest.mark.parametrize(
    ("words", "place"),
    [
        (["render", "--out", "new/set v1.5"], "new/set v1.5"),
        (["view", "set", "--out=new/page.html"], "new"),
        (["check", "left.png", "right.png", "--out=new/matches.png"], "new"),
    ],
)
def test_they_lie_in_out_and_go_away(
    words: list[str],
    place: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    with temporary_files_in_out(words):
        with tempfile.NamedTemporaryFile() as file:
            assert Path(file.name).resolve().is_relative_to(tmp_path / place / ".temporary")
        assert os.environ["TMPDIR"] == os.environ["MPLCONFIGDIR"] == tempfile.gettempdir()
    assert "MPLCONFIGDIR" not in os.environ
    assert "TMPDIR" not in os.environ
    assert not (tmp_path / place).exists()
    (said,) = capsys.readouterr().err.splitlines()
    assert "only --out can be written" in said
    assert len(said) <= 300


@pytest.mark.usefixtures("nowhere")
@pytest.mark.parametrize(
    "words", [["verify", "set"], ["render", "--out", "s3://bucket/set"], ["render", "--out"]]
)
def test_nothing_is_changed_without_a_folder_to_write(words: list[str]) -> None:
    with temporary_files_in_out(words), pytest.raises(FileNotFoundError):
        tempfile.gettempdir()


def test_nothing_is_changed_where_there_is_a_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = tempfile.gettempdir()
    with temporary_files_in_out(["render", "--out", str(tmp_path / "set")]):
        assert tempfile.gettempdir() == before
    assert not (tmp_path / "set").exists()
    assert capsys.readouterr().err == ""

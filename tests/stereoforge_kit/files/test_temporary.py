"""Temporary folders go with their makers, also with those that are killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from stereoforge_kit.files import TemporaryFolders, temporary_files_in, temporary_folder

HOLDER = """
import sys, time
from pathlib import Path
from stereoforge_kit.files import TemporaryFolders
with TemporaryFolders(Path(sys.argv[1])).new() as folder:
    (folder / "half").write_text("x")
    print(folder, flush=True)
    time.sleep(600)
"""


def start_holder(parent: Path) -> tuple[subprocess.Popen[str], Path]:
    """Another process with a folder in `parent`."""
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd())}
    words = [sys.executable, "-c", HOLDER, str(parent)]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_a_place_where_no_folder_can_be_is_an_error_and_no_endless_loop(tmp_path: Path) -> None:
    (tmp_path / "nowhere").symlink_to(tmp_path / "missing")
    (tmp_path / "file").write_text("x")
    for parent in (tmp_path / "nowhere" / "a", tmp_path / "file" / "a", tmp_path / "file"):
        with pytest.raises(OSError, match=parent.parts[-1]), TemporaryFolders(parent).new():
            pass


def test_a_folder_is_gone_at_the_end_and_its_parent_with_the_last(tmp_path: Path) -> None:
    folders = TemporaryFolders(tmp_path / "a" / "b")
    with folders.new() as first, folders.new() as second:
        assert first != second
        (first / "x").mkdir()
    assert list((tmp_path / "a").iterdir()) == []


def test_what_a_killed_process_left_is_cleared_and_what_a_living_one_has_is_not(tmp_path: Path) -> None:
    parent, cleared = tmp_path / "parent", []

    def clear(folder: Path) -> None:
        cleared.append(folder)
        subprocess.run(["rm", "-r", folder], check=True)

    living, theirs = start_holder(parent)
    killed, left = start_holder(parent)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    late, left_later = start_holder(parent)  # which clears up before it begins
    assert not left.exists()
    with TemporaryFolders(parent, clear).new() as folder:
        assert cleared == []
        late.send_signal(signal.SIGKILL)
        late.wait()
    assert set(cleared) == {folder, left_later}
    assert (theirs / "half").read_text() == "x"
    living.kill()
    living.wait()
    with TemporaryFolders(parent, clear).new():
        assert not theirs.exists()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_was_never_locked_is_an_abandoned_one(tmp_path: Path) -> None:
    (tmp_path / "parent" / "1-killed-at-once").mkdir(parents=True)
    with TemporaryFolders(tmp_path / "parent").new() as folder:
        assert [path for path in folder.parent.iterdir() if path.is_dir()] == [folder]


def test_many_at_once_do_not_disturb_each_other(tmp_path: Path) -> None:
    def use(_: int) -> None:
        with TemporaryFolders(tmp_path / "parent").new() as folder:
            (folder / "x").write_text("x")
            assert (folder / "x").read_text() == "x"

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(use, range(200)))
    assert list(tmp_path.iterdir()) == []


def test_the_system_s_place_is_private(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with temporary_folder() as folder:
        assert folder.parent.parent == tmp_path
        assert folder.parent.stat().st_mode & 0o777 == 0o700
    assert list(tmp_path.iterdir()) == []
    if os.getuid() == 0:
        place = tmp_path / "stereoforge-0"
        place.mkdir()
        os.chown(place, 12345, 12345)
        with pytest.raises(PermissionError, match="belongs to somebody else"), temporary_folder():
            pass


def test_temporary_files_go_where_they_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMP", "/elsewhere")
    before = tempfile.gettempdir()
    with temporary_files_in(tmp_path):
        assert tempfile.gettempdir() == str(tmp_path)
        made = subprocess.run(["mktemp"], capture_output=True, text=True, check=True)
        assert Path(made.stdout.strip()).parent == tmp_path
        assert os.environ["TMP"] == str(tmp_path)
    assert tempfile.gettempdir() == before
    assert os.environ["TMP"] == "/elsewhere"

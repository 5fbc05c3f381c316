"""Locks are held between processes, and freed when their holder is killed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from stereoforge_kit.files import alone, locked

HOLDER = """
import sys, time
from pathlib import Path
from stereoforge_kit.files import {lock}
with {lock}(Path(sys.argv[1]){options}):
    print("held", flush=True)
    time.sleep(600)
"""


def holding(lock: str, path: Path, options: str = "") -> subprocess.Popen[str]:
    """A process that holds a lock by now."""
    script = HOLDER.format(lock=lock, options=options)
    process = subprocess.Popen([sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "folder" / ".lock"


@pytest.mark.parametrize(("lock", "options"), [("alone", ""), ("locked", ""), ("locked", ", shared=True")])
def test_whoever_wants_to_be_alone_learns_at_once_that_it_is_not(lock: str, options: str, path: Path) -> None:
    path.parent.mkdir()
    with holding(lock, path, options) as holder:
        with pytest.raises(BlockingIOError, match=str(path)), alone(path):
            pytest.fail("two hold the lock")
        holder.kill()
        holder.wait()
        with alone(path):
            pass


def test_those_who_share_do_not_wait_for_each_other(path: Path) -> None:
    path.parent.mkdir()
    with holding("locked", path, ", shared=True") as holder:
        with locked(path, shared=True):
            pass
        holder.kill()


def test_a_lock_is_free_again_after_an_error(path: Path) -> None:
    with pytest.raises(KeyError), alone(path):
        raise KeyError
    with alone(path):
        pass

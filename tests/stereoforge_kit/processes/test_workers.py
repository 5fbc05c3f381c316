"""Calls in a worker process: results, errors, crashes, hangs and greed each end as they should."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from stereoforge_kit.processes import Limits, WorkerError, WorkerProcess, call_limited


class OddError(ValueError):
    """An error that pickle cannot bring back: its constructor takes more than its message."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(f"{first} and {second}")


def add(a: int, b: int) -> int:
    return a + b


def misbehave(kind: str) -> object:
    print(f"about to {kind}", flush=True)
    if kind == "segfault":
        ctypes.string_at(0)
    elif kind == "exit":
        os._exit(7)
    elif kind == "be killed":
        os.kill(os.getpid(), signal.SIGKILL)
    elif kind == "hang":
        time.sleep(600)
    elif kind == "grow":
        held = []
        while True:
            held.append(b"x" * (8 << 20))
            time.sleep(0.005)
    elif kind == "allocate at once":
        return len(bytearray(8 << 30))
    elif kind == "raise":
        raise FileNotFoundError(2, "there is none", "a.obj")
    elif kind == "raise oddly":
        raise OddError("this", "that")
    elif kind == "return oddly":
        return lambda: None
    return kind


def run(worker: WorkerProcess, kind: str) -> object:
    worker.start(misbehave, kind)
    while not worker.poll():
        wait(worker.waitables, 0.05)
    return worker.result()


def test_a_result_comes_back() -> None:
    assert call_limited(add, (3, 4)) == 7


def test_errors_come_back_and_the_process_lives_on() -> None:
    worker = WorkerProcess()
    try:
        with pytest.raises(FileNotFoundError) as refusal:
            run(worker, "raise")
        assert refusal.value.filename == "a.obj"
        assert "about to raise\n" in worker.output()
        assert "Traceback" in worker.output()
        with pytest.raises(RuntimeError, match="OddError: this and that"):
            run(worker, "raise oddly")
        with pytest.raises(TypeError, match="cannot be sent back"):
            run(worker, "return oddly")
        assert run(worker, "stay") == "stay"
        assert worker.output() == "about to stay\n"
    finally:
        worker.stop()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "failure", "sentence"),
    [
        ("segfault", "crash", r"its process crashed \(SIGSEGV\)"),
        ("exit", "crash", "ended with exit code 7"),
        ("be killed", "killed", r"killed from outside \(SIGKILL\)"),
        ("hang", "timeout", "longer than its limit of 1 s"),
        ("grow", "memory", r"used \d+ MiB, more than its limit of 256 MiB"),
        ("allocate at once", "memory", "could not allocate memory within its limit"),
    ],
)
def test_every_kind_of_end(kind: str, failure: str, sentence: str) -> None:
    worker = WorkerProcess(Limits(timeout_s=1.0 if kind == "hang" else 60.0, memory_bytes=256 << 20))
    try:
        with pytest.raises(WorkerError, match=sentence) as end:
            run(worker, kind)
        assert end.value.kind == failure
        assert f"about to {kind}\n" in worker.output()
        if kind == "segfault":
            assert "Fatal Python error: Segmentation fault" in worker.output()
    finally:
        worker.stop()
    assert not Path(f"/proc/{worker.pid}").exists()


PARENT = """
import sys, time
from tests.stereoforge_kit.processes.test_workers import misbehave
from stereoforge_kit.processes import WorkerProcess
if __name__ == "__main__":
    worker = WorkerProcess()
    worker.start(misbehave, "hang")
    while "about to" not in worker.output():
        time.sleep(0.05)
    print(worker.pid, flush=True)
    time.sleep(600)
"""


FORGETFUL = """
from tests.stereoforge_kit.processes.test_workers import add
from stereoforge_kit.processes import WorkerProcess
if __name__ == "__main__":
    worker = WorkerProcess()
    worker.start(add, 1, 2)
"""


@pytest.mark.slow
def test_a_program_that_forgets_its_worker_still_ends(tmp_path: Path) -> None:
    script = tmp_path / "forgetful.py"
    script.write_text(FORGETFUL)
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd())}
    assert (
        subprocess.run([sys.executable, str(script)], env=environment, timeout=120, check=False).returncode
        == 0
    )


@pytest.mark.slow
def test_a_worker_dies_with_a_parent_that_is_killed_and_nothing_is_left(tmp_path: Path) -> None:
    script, temporary = tmp_path / "parent.py", tmp_path / "temporary"
    script.write_text(PARENT)
    temporary.mkdir()
    parent = subprocess.Popen(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": str(Path.cwd()), "TMPDIR": str(temporary)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert parent.stdout is not None
    worker = int(parent.stdout.readline())
    os.kill(worker, 0)
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 20
    while Path(f"/proc/{worker}").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not Path(f"/proc/{worker}").exists()
    assert list(temporary.iterdir()) == []

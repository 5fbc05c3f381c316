"""Local workers: results, exceptions, crashes and hangs each cost what they should."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from datagen.executors import LocalExecutor


def misbehave(job: tuple[str, Path]) -> str:
    kind, folder = job
    if kind == "raise":
        raise ValueError("a sentence")
    if kind == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if kind == "crash once" and not (folder / "crashed").exists():
        (folder / "crashed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "hang":
        time.sleep(600)
    return f"{kind} done"


@pytest.mark.slow
def test_every_kind_of_end_is_an_outcome(tmp_path: Path) -> None:
    kinds = ["fine", "raise", "crash", "crash once", "hang", "fine too"]
    executor = LocalExecutor(workers=2, timeout_s=3.0)
    outcomes = {o.job[0]: o for o in executor.run(misbehave, [(kind, tmp_path) for kind in kinds])}
    assert set(outcomes) == set(kinds)
    assert [outcomes[kind].result for kind in ("fine", "crash once", "fine too")] == [
        "fine done",
        "crash once done",
        "fine too done",
    ]
    assert outcomes["raise"].error == "ValueError: a sentence"
    assert "died" in (outcomes["crash"].error or "")
    assert "time limit" in (outcomes["hang"].error or "")
    assert [outcomes[kind].result for kind in ("raise", "crash", "hang")] == [None, None, None]


@pytest.mark.slow
def test_closing_early_ends_the_workers() -> None:
    executor = LocalExecutor(workers=2)
    outcomes = executor.run(report_pid, [0, 1, 600, 600])
    pids = [next(outcomes).result, next(outcomes).result]
    start = time.monotonic()
    outcomes.close()
    assert time.monotonic() - start < 30
    for pid in pids:
        assert pid is not None
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def report_pid(seconds: int) -> int:
    time.sleep(seconds if seconds > 1 else 0)
    return os.getpid()

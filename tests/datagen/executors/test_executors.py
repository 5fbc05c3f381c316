"""Executors: results, exceptions, crashes and hangs each cost what they should; nothing is left running."""

from __future__ import annotations

import ctypes
import hashlib
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from datagen.executors import LocalExecutor, WorkerPolicy, supervisor
from datagen.executors.devices import assign_devices, find_gpus
from scenes.shapes import SHAPES
from stereoforge_kit.processes import Limits


def misbehave(job: tuple[str, Path]) -> str:
    kind, folder = job
    print(f"this is {kind}", flush=True)
    if kind == "raise":
        raise ValueError("a sentence")
    if kind == "no space":
        raise OSError(28, "No space left on device", "a.png")
    if kind == "crash":
        ctypes.string_at(0)
    if kind == "crash once" and not (folder / "crashed").exists():
        (folder / "crashed").touch()
        ctypes.string_at(0)
    if kind == "be killed often":
        with (folder / "kills").open("a") as kills:
            kills.write("x")
        if len((folder / "kills").read_text()) < 12:
            os.kill(os.getpid(), signal.SIGKILL)
    if kind == "hang":
        time.sleep(600)
    if kind == "hang and be killed":
        time.sleep(0.4)
        os.kill(os.getpid(), signal.SIGKILL)
    return f"{kind} done"


@pytest.mark.slow
def test_every_kind_of_end_is_an_outcome(tmp_path: Path) -> None:
    kinds = ["fine", "raise", "no space", "crash", "crash once", "be killed often", "hang", "fine too"]
    executor = LocalExecutor(({},) * 2, WorkerPolicy(Limits(timeout_s=1.0)))
    outcomes = {o.job[0]: o for o in executor.run(misbehave, [(kind, tmp_path) for kind in kinds])}
    assert set(outcomes) == set(kinds)
    good = ("fine", "crash once", "be killed often", "fine too")
    assert [(outcomes[kind].result, outcomes[kind].attempts) for kind in good] == [
        ("fine done", 1),
        ("crash once done", 2),
        ("be killed often done", 12),
        ("fine too done", 1),
    ]
    ends = {kind: outcomes[kind].failure for kind in kinds if kind not in good}
    described = {kind: (end.kind, end.sentence) for kind, end in ends.items() if end}
    assert described == {
        "raise": ("exception", "ValueError: a sentence"),
        "no space": ("disk_full", "OSError: [Errno 28] No space left on device: 'a.png'"),
        "crash": ("crash", "its process crashed (SIGSEGV)"),
        "hang": ("timeout", "ran longer than its limit of 1 s"),
    }
    assert [outcomes[kind].attempts for kind in described] == [1, 1, 2, 2]
    assert all(end is not None and f"this is {kind}" in end.output for kind, end in ends.items())


@dataclass(frozen=True)
class KillsOnArrival:
    """A job whose first few processes are killed while they unpickle it, before they begin."""

    folder: Path
    times: int

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        with (self.folder / "starts").open("a") as starts:
            starts.write("x")
        if len((self.folder / "starts").read_text()) <= self.times:
            os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_a_job_that_hangs_is_found_out_though_every_attempt_is_killed_before_its_time(tmp_path: Path) -> None:
    executor = LocalExecutor(({},), WorkerPolicy(Limits(timeout_s=0.6)))
    (outcome,) = executor.run(misbehave, [("hang and be killed", tmp_path)])
    assert outcome.failure is not None
    assert outcome.failure.kind == "timeout"
    assert (
        "attempts, which were killed from outside, without an end: more than the 1.2 s"
        in outcome.failure.sentence
    )
    assert 2 <= outcome.attempts <= 3


def succeed(job: object) -> bool:
    return job is not None


@pytest.mark.slow
def test_a_process_killed_before_it_begins_does_not_count_against_the_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "MAX_KILLS", 2)
    (outcome,) = LocalExecutor(({},)).run(succeed, [KillsOnArrival(tmp_path, 3)])
    assert (outcome.result, outcome.attempts) == (True, 4)
    # But no process that ever comes up is a fault of the machine that somebody has to be told of.
    monkeypatch.setattr(supervisor, "MAX_STARTS_KILLED", 2)
    (outcome,) = LocalExecutor(({},)).run(succeed, [KillsOnArrival(tmp_path, 100)])
    assert outcome.failure is not None
    assert (outcome.failure.kind, outcome.attempts) == ("killed", 2)


def report_pid(seconds: int) -> int:
    time.sleep(seconds if seconds > 1 else 0)
    return os.getpid()


@pytest.mark.slow
def test_closing_early_ends_the_workers() -> None:
    outcomes = LocalExecutor(({},) * 2).run(report_pid, [0, 1, 600, 600])
    pids = [next(outcomes).result, next(outcomes).result]
    start = time.monotonic()
    outcomes.close()
    assert time.monotonic() - start < 30
    for pid in pids:
        assert pid is not None
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def grow(megabytes: int) -> int:
    HELD.append(b"x" * (megabytes << 20))
    return os.getpid()


HELD: list[bytes] = []


@pytest.mark.slow
def test_workers_are_recycled_by_jobs_and_by_memory() -> None:
    by_jobs = LocalExecutor(({},), WorkerPolicy(jobs_per_worker=2))
    pids = [outcome.result for outcome in by_jobs.run(report_pid, [0] * 4)]
    assert pids[0] == pids[1] != pids[2] == pids[3]
    by_memory = LocalExecutor(({},), WorkerPolicy(recycle_bytes=400 << 20))
    pids = [outcome.result for outcome in by_memory.run(grow, [1, 500, 1])]
    assert pids[0] == pids[1] != pids[2]


def gpu_seen(_: int) -> str | None:
    time.sleep(0.5)
    return os.environ.get("CUDA_VISIBLE_DEVICES")


@pytest.mark.slow
def test_each_worker_has_its_environment() -> None:
    environments = tuple({"CUDA_VISIBLE_DEVICES": str(index)} for index in range(2))
    executor = LocalExecutor(environments)
    assert {outcome.result for outcome in executor.run(gpu_seen, range(4))} == {"0", "1"}


def mesh_hash(seed: int) -> str:
    mesh = SHAPES["Terrain"].sample(np.random.default_rng(seed)).mesh()
    return hashlib.sha256(mesh.vertices.tobytes()).hexdigest()


@pytest.mark.slow
def test_a_mesh_s_last_bits_do_not_tell_how_many_cores_there_were(monkeypatch: pytest.MonkeyPatch) -> None:
    hashes = []
    for threads in ("1", "4"):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)  # As many as OpenBLAS takes, if told nothing else.
        hashes.append([outcome.result for outcome in LocalExecutor(({},)).run(mesh_hash, range(3))])
    assert hashes[0] == hashes[1]


def test_one_worker_a_gpu_and_each_its_own() -> None:
    assert assign_devices("cpu", [], 3) == ({}, {}, {})
    two = ({"CUDA_VISIBLE_DEVICES": "0"}, {"CUDA_VISIBLE_DEVICES": "GPU-ab"})
    assert assign_devices("optix", ["0", "GPU-ab"]) == two
    assert assign_devices("cuda", ["0", "GPU-ab"], 3) == (*two, two[0])
    assert assign_devices("hip", ["0", "1"], 1) == ({"HIP_VISIBLE_DEVICES": "0"},)
    assert assign_devices("metal", [], None) == ({},)


def test_gpus_that_the_environment_names_are_those_to_use() -> None:
    assert find_gpus("cuda", {"CUDA_VISIBLE_DEVICES": "2, 5"}) == ["2", "5"]
    assert find_gpus("hip", {"HIP_VISIBLE_DEVICES": ""}) == []
    assert find_gpus("cpu", {"CUDA_VISIBLE_DEVICES": "2"}) == []

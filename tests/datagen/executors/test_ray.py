"""Rendering on a Ray cluster: the same data set, also when a machine is lost on the way."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import ray
from ray.cluster_utils import Cluster

from datagen import render_dataset
from datagen.dataset.manifest import SceneManifest
from datagen.executors import RayExecutor, WorkerPolicy
from stereoforge_kit.processes import Limits
from tests.datagen.executors.test_executors import misbehave
from tests.datagen.sabotage import RECIPE, hashes

FIRST, SECOND = "127.0.0.2", "127.0.0.3"
"""Addresses of this machine alone; Ray would replace 127.0.0.1 by one that others can reach."""


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """Two machines of one CPU each, both of them this one."""
    here = {"num_cpus": 1, "include_dashboard": False, "node_ip_address": FIRST}
    # Ray's workers import what they run from where this process does.
    paths = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = str(Path.cwd())
    cluster = Cluster(initialize_head=True, head_node_args=here)
    try:
        ray.init(address=cluster.address, _node_ip_address=FIRST, log_to_driver=False, logging_level="ERROR")
        yield cluster
    finally:
        ray.shutdown()
        cluster.shutdown()
        os.environ.pop("PYTHONPATH")
        if paths is not None:
            os.environ["PYTHONPATH"] = paths


@pytest.mark.slow
def test_faults_cost_what_they_cost_locally(cluster: Cluster, tmp_path: Path) -> None:  # noqa: ARG001
    kinds = ["fine", "raise", "crash", "be killed often", "hang"]
    executor = RayExecutor(policy=WorkerPolicy(Limits(timeout_s=1.0)))
    outcomes = {o.job[0]: o for o in executor.run(misbehave, [(kind, tmp_path) for kind in kinds])}
    ends = {
        kind: (end.result, end.failure and end.failure.kind, end.attempts) for kind, end in outcomes.items()
    }
    assert ends == {
        "fine": ("fine done", None, 1),
        "raise": (None, "exception", 1),
        "crash": (None, "crash", 2),
        "be killed often": ("be killed often done", None, 12),
        "hang": (None, "timeout", 2),
    }
    failure = outcomes["crash"].failure
    assert failure is not None
    assert "Segmentation fault" in failure.output


@pytest.mark.slow
def test_a_machine_lost_mid_run_costs_nothing(
    cluster: Cluster, small_reference: Path, tmp_path: Path
) -> None:
    second: Any = cluster.add_node(num_cpus=1, node_ip_address=SECOND)
    cluster.wait_for_nodes()
    lost: list[int] = []

    def on_scene(done: int, _: int, manifest: SceneManifest | None) -> None:
        assert manifest is not None
        if done == 1:
            cluster.remove_node(second, allow_graceful=False)
            lost.append(done)

    summary = render_dataset(RECIPE, tmp_path / "set", executor=RayExecutor(), on_scene=on_scene)
    assert lost == [1]
    assert (summary.rendered, summary.failures) == (4, ())
    assert hashes(tmp_path / "set") == hashes(small_reference)
    assert sorted(path.name for path in (tmp_path / "set").iterdir() if path.name.startswith(".")) == []


def sleep(seconds: int) -> int:
    time.sleep(seconds)
    return os.getpid()


@pytest.mark.slow
def test_closing_early_ends_the_work(cluster: Cluster) -> None:  # noqa: ARG001
    outcomes = RayExecutor().run(sleep, [0, 600])
    assert next(outcomes).result
    outcomes.close()
    deadline = time.monotonic() + 60
    while ray.available_resources().get("CPU", 0) < 1 and time.monotonic() < deadline:
        time.sleep(0.2)
    assert ray.available_resources().get("CPU", 0) >= 1

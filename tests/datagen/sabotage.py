"""Faults on demand: an executor that lets chosen scenes crash, hang, eat memory or fill the disk."""

from __future__ import annotations

import ctypes
import errno
import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from datagen import Recipe
from datagen.executors import Executor, LocalExecutor, Outcomes, WorkerPolicy
from datagen.rendering.scene_job import SceneJob
from scenes import FAMILIES
from stereoforge_kit.processes import Limits

NOT_DATA = ("logs", "quarantine", "README.md", "card.png")
"""The card says how many scenes there are, so it differs where one is missing; `test_card.py` has its own tests."""

WORLD = FAMILIES["flying_things"].config(
    width=64,
    height=36,
    flying_objects=(1, 1),
    background_objects=(1, 1),
    background_materials=(1, 1),
    pitch_deg=(25.0, 30.0),
)
RECIPE = Recipe(WORLD, {"train": 4}, seed=3, samples=1)
"""Four of the smallest scenes there are."""
ONE_WORKER = LocalExecutor(({},), WorkerPolicy(Limits(memory_bytes=1200 << 20)))


@dataclass(frozen=True)
class Sabotage:
    """Runs jobs as `inner` does, but spoils the scenes named in `faults`."""

    inner: Executor
    faults: Mapping[str, str]
    """What happens to a scene, by its name such as `train/0002`."""

    @property
    def threads(self) -> int:
        return self.inner.threads

    def run(self, function: Callable[[Any], Any], jobs: Iterable[Any]) -> Outcomes[Any, Any]:
        return self.inner.run(partial(spoil, function, dict(self.faults)), jobs)


def spoil(function: Callable[[SceneJob], Any], faults: Mapping[str, str], job: SceneJob) -> Any:
    fault = faults.get(job.name)
    if fault:
        print(f"{job.name} is about to {fault}", flush=True)
    if fault == "segfault":
        ctypes.string_at(0)
    elif fault == "hang":
        time.sleep(3600)
    elif fault == "eat memory":
        held = []
        while True:
            held.append(b"x" * (16 << 20))
            time.sleep(0.002)
    elif fault == "raise":
        raise RuntimeError("out of ideas")
    elif fault == "fill the disk":
        raise OSError(errno.ENOSPC, "No space left on device", "0006.png")
    elif fault and fault.startswith("errno "):
        number = int(fault.removeprefix("errno "))
        raise OSError(number, os.strerror(number), "0006.png")
    return function(job)


def hashes(root: Path) -> dict[str, str]:
    """SHA-256 of every file of the data; of manifests only what they say of the files, since timings differ."""
    found = {}
    for path in sorted(path for path in root.rglob("*") if path.is_file()):
        name = path.relative_to(root).as_posix()
        if not name.startswith(NOT_DATA):
            found[name] = file_hash(root, name)
    return found


def file_hash(root: Path, name: str) -> str:
    """SHA-256 of a file, as `hashes` has it."""
    data = (root / name).read_bytes()
    if name.startswith("manifest/"):
        manifest = json.loads(data)
        del manifest["seconds"], manifest["manifest_sha256"]
        data = json.dumps(manifest).encode()
    return hashlib.sha256(data).hexdigest()


def without(found: dict[str, str], *scenes: str) -> dict[str, str]:
    """The hashes of a data set but for some of its scenes, which are given by their four digits."""
    return {
        name: digest for name, digest in found.items() if not any(f"/{scene}" in name for scene in scenes)
    }

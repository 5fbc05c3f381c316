"""Pairs an hour, where the time goes, and whether the workers' memory stays flat.

    python benchmarks/render.py [--family flying_things] [--scenes 8] [--size 960x540] [--workers N]

Renders into a temporary folder with the shipped settings. The split is read from the manifests, memory from the
running workers. With 200 scenes of a small size the memory column answers whether a long run grows.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import threading
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

from datagen import Recipe, render_dataset
from datagen.dataset.layout import Layout
from datagen.dataset.manifest import SceneManifest, read_manifest
from scenes import FAMILIES

SAMPLING = "render"
"""The step that is Cycles' own; its preparation of the scene is in it too."""


class WorkerMemory(threading.Thread):
    """Samples the resident memory of every child process once a second."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.megabytes: dict[int, list[float]] = defaultdict(list)
        self._stop_asked = threading.Event()

    def run(self) -> None:
        while not self._stop_asked.wait(1.0):
            for pid in _children(os.getpid()):
                size = _resident_mb(pid)
                if size > 100:  # multiprocessing's helpers are small
                    self.megabytes[pid].append(size)

    def stop(self) -> None:
        self._stop_asked.set()
        self.join()


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task")
    listed = [
        (task / "children").read_text().split() for task in tasks.iterdir() if (task / "children").exists()
    ]
    direct = [int(child) for names in listed for child in names]
    return direct + [
        grandchild for child in direct if Path(f"/proc/{child}").exists() for grandchild in _children(child)
    ]


def _resident_mb(pid: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except OSError:
        return 0.0


def report(manifests: list[SceneManifest], pairs: int, seconds: float, memory: WorkerMemory) -> None:
    steps = list(manifests[0].seconds)
    totals = {step: sum(manifest.seconds[step] for manifest in manifests) for step in steps}
    whole = sum(totals.values())
    print(f"\n{pairs} pairs in {seconds:.0f} s: {pairs / seconds * 3600:.0f} pairs an hour")
    print("\n| step | s a scene (median) | share |\n|---|---|---|")
    for step in steps:
        median = np.median([manifest.seconds[step] for manifest in manifests])
        print(f"| {step} | {median:.2f} | {totals[step] / whole:.1%} |")
    print(f"\nnot Cycles: {1 - totals[SAMPLING] / whole:.1%} of the workers' time")
    for pid, sizes in memory.megabytes.items():
        quarter = max(1, len(sizes) // 4)
        early, late = np.max(sizes[quarter : 2 * quarter] or sizes), np.max(sizes[-quarter:])
        print(
            f"worker {pid}: peak {max(sizes):.0f} MB; second quarter {early:.0f}, last quarter {late:.0f} MB"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--family", default="flying_things", choices=sorted(FAMILIES))
    parser.add_argument("--scenes", type=int, default=8)
    parser.add_argument("--size", default="960x540")
    parser.add_argument("--frames", type=int, default=1)
    parser.add_argument("--workers", type=int, default=None)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    world = FAMILIES[arguments.family].config(width=width, height=height, frames=arguments.frames)
    recipe = Recipe(world, {"train": arguments.scenes})
    with tempfile.TemporaryDirectory() as folder:
        memory = WorkerMemory()
        memory.start()
        started = time.monotonic()
        summary = render_dataset(
            recipe,
            folder,
            workers=arguments.workers,
            on_scene=lambda done, total, _: print(f"{done}/{total}", end=" ", flush=True),
        )
        seconds = time.monotonic() - started
        memory.stop()
        layout = Layout(Path(folder))
        manifests = [
            read_manifest(layout.manifest("train", scene)) for scene in layout.committed_scenes("train")
        ]
        report(manifests, summary.rendered * arguments.frames, seconds, memory)


if __name__ == "__main__":
    main()

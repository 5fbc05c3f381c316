"""A folder of pairs: seconds a pair beside network and refinement alone, and whether memory stays flat.

    python -m benchmarks.folder [--pairs 10 25 50] [--size 1242x375] [--alone 10]

Draws pairs, then runs `stereoforge refine` on as many of them as each number says, in a process of its own whose peak
of resident memory is the system's count (VmHWM, Linux). `--alone` pairs are predicted and then refined in one process,
without files; the medians are given.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import cv2
import numpy as np
from numpy.typing import NDArray

from stereoforge.pipelines.refiner import StereoRefiner

COMMAND = """
from benchmarks.refine import memory_peak
from stereoforge.cli import main

try:
    main()
finally:
    print("peak", memory_peak())
"""

Picture = NDArray[np.uint8]


def drawn_pair(seed: int, width: int, height: int) -> tuple[Picture, Picture]:
    """Blotches of every size on a ground that comes nearer downwards, with boxes before it; (H, W, 3) each."""
    rng = np.random.default_rng(seed)
    left = np.zeros((height, width, 3), np.float32)
    for size in (2, 6, 20, 60):
        blotches = rng.normal(0, 1, (height // size + 2, width // size + 2, 3)).astype(np.float32)
        left += cv2.resize(blotches, (width, height), interpolation=cv2.INTER_CUBIC)
    disparity = np.broadcast_to(np.linspace(4, 40, height, dtype=np.float32)[:, None], (height, width)).copy()
    for _ in range(8):
        x, y = int(rng.integers(0, width - 80)), int(rng.integers(0, height - 60))
        disparity[y : y + 60, x : x + 80] = rng.uniform(20, 60)
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    right = cv2.remap(left, columns + disparity, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    first, second = (np.clip(128 + 30 * view, 0, 255).astype(np.uint8) for view in (left, right))
    return first, second


def write_pairs(folder: Path, count: int, width: int, height: int) -> None:
    for side in ("left", "right"):
        (folder / side).mkdir()
    for index in range(count):
        for side, picture in zip(("left", "right"), drawn_pair(index, width, height), strict=True):
            cv2.imwrite(str(folder / side / f"{index:04d}.png"), picture[:, :, ::-1])


def run_command(folder: Path, count: int) -> tuple[float, float]:
    """Seconds a pair, start included, and the peak of resident memory in GB of `refine` on the first pairs."""
    pairs = folder / f"pairs_{count}.txt"
    names = sorted(path.name for path in (folder / "left").iterdir())[:count]
    pairs.write_text("".join(f"{folder}/left/{name} {folder}/right/{name}\n" for name in names))
    began = time.perf_counter()
    arguments = ["refine", str(pairs), "--out", str(folder / f"out_{count}")]
    ended = subprocess.run(
        [sys.executable, "-c", COMMAND, *arguments], check=True, capture_output=True, text=True
    )
    seconds = time.perf_counter() - began
    return seconds / count, int(ended.stdout.split()[-1]) / 2**30


def alone(count: int, width: int, height: int) -> tuple[float, float]:
    """Median seconds of the networks and of the refinement on arrays, after one pair that is not counted."""
    refiner, network, refinement = StereoRefiner(), [], []
    for index in range(count + 1):
        left, right = drawn_pair(index, width, height)
        began = time.perf_counter()
        prediction = refiner.predict(left, right)
        between = time.perf_counter()
        refiner.refine(left, prediction)
        network.append(between - began)
        refinement.append(time.perf_counter() - between)
    return median(network[1:]), median(refinement[1:])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pairs", type=int, nargs="+", default=[10, 25, 50])
    parser.add_argument("--size", default="1242x375")
    parser.add_argument("--alone", type=int, default=10)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    network, refinement = alone(arguments.alone, width, height)
    print(f"alone: network {network:.2f} s, refinement {refinement:.2f} s a pair")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_pairs(folder, max(arguments.pairs), width, height)
        for count in arguments.pairs:
            seconds, peak = run_command(folder, count)
            ratio = seconds / (network + refinement)
            print(f"{count} pairs: {seconds:.2f} s a pair, {ratio:.2f} x both alone; peak {peak:.2f} GB")


if __name__ == "__main__":
    main()

"""The MRF's solver beside its rivals: seconds, deviation from the direct solution, growth with size, memory.

    python -m benchmarks.refine --data DATASET [--weights RUN] [--repeat 3] [--threads 2]
        [--skip-direct] [--skip-sgbm] [--large] [--crop 100]
    python -m benchmarks.refine --toy 240x180 [--repeat 1]

Takes the first frame of a rendered data set. With --weights its disparity, confidence and gradient are what the run's
networks predict. The harder cases are made of other real parts: OpenCV's SGBM with holes filled as initial disparity,
its left-right agreement as confidence (0 over large areas), the true gradients with noise; "sparse" keeps one confident
pixel in a hundred. --toy takes a small drawn frame instead and needs no data set.

Every rival solves the same arrays, weights and set-up included, in turn within each repetition; the table gives
medians of wall clock and CPU. The rivals know one thread only; --threads is ours. pyamg comes with the development
requirements; without it the two solvers that need it are left out.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import numba
import numpy as np

from refine.energy.affinity import Floats
from refine.energy.parameters import MRFParameters
from refine.energy.system import Form, build_system

Inputs = tuple[Floats, Floats, Floats, np.ndarray]


def frame_inputs(root: Path, split: str) -> Inputs:
    """Disparity, confidence, gradient and image of the data set's first frame."""
    from datagen import StereoDataset
    from refine.metrics import forward_gradient
    from stereoforge_kit.matching import fill_background, match_sgbm

    sample = StereoDataset(root, split)[0]
    left, right = sample.left, sample.right
    found = match_sgbm(left, right)
    mirrored = match_sgbm(np.ascontiguousarray(right[:, ::-1]), np.ascontiguousarray(left[:, ::-1]))[:, ::-1]
    column = np.arange(left.shape[1]) - np.nan_to_num(found)
    nearest = np.clip(np.rint(column).astype(int), 0, left.shape[1] - 1)
    apart = np.abs(found - np.take_along_axis(mirrored, nearest, axis=1))
    confidence = np.where(np.isfinite(apart) & (column > 0), np.exp(-(np.nan_to_num(apart) ** 2) / 2), 0)
    confidence[confidence < 0.05] = 0
    rng = np.random.default_rng(0)
    gradient = forward_gradient(sample.disparity_left)
    gradient = np.where(np.abs(gradient) <= 1, gradient, 0) + rng.normal(0, 0.05, gradient.shape)
    return fill_background(found).astype(np.float64), confidence, gradient, left


def predicted_inputs(root: Path, split: str, weights: Path) -> Inputs:
    """The same frame with what trained networks make of it."""
    from datagen import StereoDataset
    from training.prediction.predictor import StereoPredictor

    sample = StereoDataset(root, split)[0]
    found = StereoPredictor(weights).predict(sample.left, sample.right)
    if found.confidence is None or found.gradient is None:
        raise SystemExit(f"{weights} has no ConfNet or no GradNet")
    disparity, confidence, gradient = (
        values.astype(np.float64) for values in (found.disparity, found.confidence, found.gradient)
    )
    return disparity, confidence, gradient, sample.left


def toy_inputs(height: int, width: int) -> Inputs:
    """A slanted plane behind a box, with a disparity that is fattened around the box and noisy."""
    from tests.refine.worlds import toy_frame

    frame = toy_frame(0, height, width)
    disparity, confidence, gradient = (
        values.astype(np.float64) for values in (frame.disparity, frame.confidence, frame.gradient)
    )
    return disparity, confidence, gradient, frame.image


def sparse(inputs: Inputs) -> Inputs:
    """The same with confidence 0 at 99 of 100 pixels."""
    disparity, confidence, gradient, image = inputs
    keep = np.random.default_rng(1).random(confidence.shape) < 0.01
    return disparity, np.where(keep, confidence, 0), gradient, image


def ours(inputs: Inputs, form: Form) -> Floats:
    from refine import solve_mrf

    return solve_mrf(*inputs, form=form, solver="multigrid").disparity


def pyamg_cg(inputs: Inputs, form: Form) -> Floats:
    """Ruge and Stueben's multigrid on A itself, and CG."""
    import pyamg

    system = build_system(*inputs, MRFParameters(), form)
    hierarchy = pyamg.ruge_stuben_solver(system.matrix().tocsr())
    solved: Floats = hierarchy.solve(
        system.right_hand_side, x0=inputs[0].ravel(), tol=1e-7, accel="cg", maxiter=1000
    )
    return solved.reshape(system.shape)


def reference(inputs: Inputs, form: Form) -> Floats:
    """CG on A, preconditioned by Ruge and Stueben's multigrid on an M-matrix: the readable reference in pyamg, this
    project's former solver."""
    from tests.refine.ruge_stueben import solve_ruge_stueben

    solved, _ = solve_ruge_stueben(build_system(*inputs, MRFParameters(), form), inputs[0], tolerance=1e-7)
    return solved


def spsolve(inputs: Inputs, form: Form) -> Floats:
    from scipy.sparse.linalg import spsolve as scipy_spsolve

    system = build_system(*inputs, MRFParameters(), form)
    solved: Floats = scipy_spsolve(system.matrix().tocsc(), system.right_hand_side)
    return solved.reshape(system.shape)


def timed(run: Callable[[], Floats]) -> tuple[Floats, float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    result = run()
    return result, time.perf_counter() - wall, time.process_time() - cpu


def compare(
    name: str, inputs: Inputs, form: Form, rivals: list[Callable[[Inputs, Form], Floats]], repeat: int
) -> None:
    """One table: all rivals in turn, `repeat` times."""
    from refine import solve_mrf

    exact = solve_mrf(*inputs, form=form, solver="direct").disparity
    ours(inputs, form)  # compiles
    runs: dict[str, list[tuple[float, float]]] = {rival.__name__: [] for rival in rivals}
    deviation = {}
    for _ in range(repeat):
        for rival in rivals:
            found, wall, cpu = timed(partial(rival, inputs, form))
            runs[rival.__name__].append((wall, cpu))
            deviation[rival.__name__] = np.abs(found - exact).max()
    height, width = exact.shape
    print(f"\n{name}, {form} form, {width}x{height}\n")
    print("| solver | seconds | CPU seconds | times ours | largest deviation, px |\n|---|---|---|---|---|")
    base = median(wall for wall, _ in runs["ours"])
    for rival, times in runs.items():
        wall, cpu = (median(column) for column in zip(*times, strict=True))
        print(
            f"| {rival} | {wall:.2f} | {cpu:.2f} | {wall / base:.1f} | {deviation[rival]:.4f} |", flush=True
        )


def enlarged(inputs: Inputs, factor: int) -> Inputs:
    """A larger world of the same grain: the frame tiled, every other tile mirrored."""
    disparity, confidence, gradient, image = inputs

    def tile(values: np.ndarray) -> np.ndarray:
        row = np.concatenate([values if i % 2 == 0 else values[:, ::-1] for i in range(factor)], axis=1)
        return np.concatenate([row if i % 2 == 0 else row[::-1] for i in range(factor)], axis=0)

    return tile(disparity), tile(confidence), tile(gradient), tile(image)


def center(inputs: Inputs, size: int) -> Inputs:
    """So many pixels each way from the frame's middle."""
    middle = tuple(slice(max(0, n // 2 - size), n // 2 + size) for n in inputs[0].shape)
    return inputs[0][middle], inputs[1][middle], inputs[2][middle], inputs[3][middle]


def memory_peak() -> int:
    """The most memory this process held at once, in bytes (Linux)."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) * 1024


def measure_size(path: str) -> None:
    """Child process: one solve of the stored arrays; megapixels, seconds, memory in float32 images."""
    from refine import solve_mrf
    from tests.refine.worlds import random_problem

    solve_mrf(*random_problem(70, 90, 0).inputs, solver="multigrid")  # loads the compiled kernels
    with np.load(path) as stored:
        inputs = tuple(stored[key] for key in ("disparity", "confidence", "gradient", "image"))
    Path("/proc/self/clear_refs").write_text("5")  # the peak is what it is now
    before = memory_peak()
    solution = solve_mrf(*inputs, solver="multigrid")
    grown = memory_peak() - before
    pixels = inputs[0].size
    print(
        f"| {inputs[0].shape[1]}x{inputs[0].shape[0]} | {solution.info.seconds:.2f} "
        f"| {solution.info.seconds / pixels * 1e6:.2f} | {solution.info.iterations} | {grown / 4 / pixels:.0f} |"
    )


def enlarged_sizes(inputs: Inputs, factors: tuple[int, ...], threads: int) -> None:
    """The table of growth with size, each size in a fresh process."""
    print(
        "\n| size | seconds | microseconds a pixel | iterations | peak, float32 images |\n|---|---|---|---|---|",
        flush=True,
    )
    for factor in factors:
        with tempfile.TemporaryDirectory() as folder:
            path = f"{folder}/inputs.npz"
            keys = ("disparity", "confidence", "gradient", "image")
            np.savez(path, **dict(zip(keys, enlarged(inputs, factor), strict=True)))
            command = [sys.executable, "-m", "benchmarks.refine", "--threads", str(threads), "--child", path]
            subprocess.run(command, check=True)


def parsed_options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path)
    parser.add_argument("--split", default="train")
    parser.add_argument("--weights", type=Path, help="a run with regressor, ConfNet and GradNet")
    parser.add_argument("--toy", help="WIDTHxHEIGHT of a drawn frame, in place of a data set")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--skip-direct", action="store_true", help="leave spsolve on the paper's form out")
    parser.add_argument("--skip-sgbm", action="store_true", help="leave the harder cases out")
    parser.add_argument("--large", action="store_true", help="also 1920x1080 and 3840x2160")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--crop", type=int, default=0, help="only this many pixels from the centre each way")
    options = parser.parse_args()
    if not (options.data or options.toy or options.child):
        parser.error("--data DATASET or --toy WIDTHxHEIGHT is needed")
    return options


def chosen_cases(options: argparse.Namespace) -> dict[str, Inputs]:
    """The inputs that the options ask for, by name."""
    cases: dict[str, Inputs] = {}
    if options.toy:
        width, height = (int(number) for number in options.toy.split("x"))
        cases["toy"] = toy_inputs(height, width)
    elif options.weights:
        cases["networks"] = predicted_inputs(options.data, options.split, options.weights)
    if options.data and not options.skip_sgbm:
        cases["SGBM"] = frame_inputs(options.data, options.split)
        cases["sparse"] = sparse(cases["SGBM"])
    if not cases:
        raise SystemExit("--skip-sgbm leaves nothing to solve without --weights")
    if options.crop:
        cases = {name: center(inputs, options.crop) for name, inputs in cases.items()}
    return cases


def main() -> None:
    options = parsed_options()
    numba.set_num_threads(options.threads)
    if options.child:
        measure_size(options.child)
        return
    cases = chosen_cases(options)
    rivals = [ours, reference, pyamg_cg]
    if importlib.util.find_spec("pyamg") is None:
        print("pyamg is not installed, so the two solvers that need it are left out (pip install pyamg)")
        rivals = [ours]
    for name, inputs in cases.items():
        empty = 1 - (inputs[1] > MRFParameters().confidence_floor).mean()
        print(f"{name}: confidence is at its floor at {empty:.0%} of the pixels; {options.threads} threads")
        compare(name, inputs, "exact", rivals, options.repeat)
    first, inputs = next(iter(cases.items()))
    if not options.skip_direct:
        compare(first, inputs, "paper", [ours, spsolve], options.repeat)
    enlarged_sizes(inputs, (1, 2, 4) if options.large else (1,), options.threads)


if __name__ == "__main__":
    main()

"""How fast training is: every preset, the data pipeline, and one iteration against other implementations.

    python -m benchmarks.train presets                       iterations a second and peak memory of each preset
    python -m benchmarks.train data --data DIR               crops a second against what `small` consumes
    python -m benchmarks.train rivals [--fadnet FOLDER]      one iteration against plain PyTorch and FADNet's DispNetC

Rivals are timed in turns, in one process on one thread, by CPU time, so that other work on the machine disturbs them
alike. FADNet's code (github.com/HKBU-HPML/FADNet) is not part of this project: clone it and name the folder.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.profiler import ProfilerActivity, profile

from benchmarks.plain_dispnet import PlainDispNet
from training.data.batch import StereoBatch
from training.data.pipeline import StereoDataModule, open_sources
from training.losses import multiscale_l1
from training.networks import ConfNet, DispNetConfig, GradNet, Regressor
from training.networks.layout import faster_layout
from training.networks.regressors.registry import regressor_for
from training.preset_kinds import (
    ConfNetPreset,
    FineTuningPreset,
    GradNetPreset,
    Preset,
    RegressorFreeConfNetPreset,
    RegressorFreeGradNetPreset,
    RegressorPreset,
)
from training.presets import PRESETS, REGRESSOR_PRESETS, find_preset
from training.tasks import (
    ConfNetTask,
    FineTuningTask,
    GradNetTask,
    RegressorFreeConfNetTask,
    RegressorFreeGradNetTask,
    RegressorTask,
    StereoTask,
)

Step = Callable[[], None]


def random_batch(preset: Preset, crops: int) -> StereoBatch:
    """Crops of noise: what they show does not change the time."""
    size = (preset.crop_height, preset.crop_width)
    torch.manual_seed(0)
    return StereoBatch(
        left=torch.rand(crops, 3, *size),
        right=torch.rand(crops, 3, *size),
        disparity=torch.rand(crops, 1, *size) * 60,
        gradient=torch.rand(crops, 2, *size) - 0.5,
    )


def build_regressor(preset: RegressorPreset) -> Regressor:
    """A new network of a preset."""
    return regressor_for(preset.network)(preset.network)


def build_task(preset: Preset, regressor_preset: RegressorPreset) -> StereoTask:
    """The task of a preset on new networks."""
    network = build_regressor(regressor_preset)
    if isinstance(preset, RegressorPreset):
        return RegressorTask(preset, build_regressor(preset), preset.steps, 0)
    if isinstance(preset, FineTuningPreset):
        return FineTuningTask(preset, network, preset.steps, 0)
    if isinstance(preset, RegressorFreeConfNetPreset):
        return RegressorFreeConfNetTask(preset, ConfNet(preset.network), preset.steps, 0)
    if isinstance(preset, RegressorFreeGradNetPreset):
        return RegressorFreeGradNetTask(preset, GradNet(preset.network), preset.steps, 0)
    if isinstance(preset, ConfNetPreset):
        head = ConfNet(preset.network.on(network))
        return ConfNetTask(preset, network, head, preset.steps, 0)
    if isinstance(preset, GradNetPreset):
        grad_head = GradNet(preset.network.on(network))
        return GradNetTask(preset, network, grad_head, preset.steps, 0)
    raise TypeError(f"no task trains a {type(preset).__name__}")


def our_step(task: StereoTask, batch: StereoBatch, bf16: bool = False) -> Step:
    """One iteration as `training.runs.train` runs it on a CPU."""
    faster_layout(task)
    task.train()
    task.mixed_precision = bf16
    optimizer = task.configure_optimizers()["optimizer"]

    def step() -> None:
        with torch.autocast("cpu", torch.bfloat16, enabled=bf16):
            if isinstance(
                task, RegressorTask
            ):  # the schedule's step comes from the trainer, which is not here
                predictions = task.network(batch.left, batch.right).disparities
                loss = multiscale_l1(predictions, batch.disparity, [0.2] * 5 + [1.0])
            else:
                loss = task.loss(batch)
        optimizer.zero_grad()
        loss.backward()
        if task.preset.optimizer.clip_norm is not None:
            nn.utils.clip_grad_norm_(task.network.parameters(), task.preset.optimizer.clip_norm)
        optimizer.step()

    return step


def rival_step(
    network: nn.Module, predict: Callable[[], list[Tensor]], batch: StereoBatch, clip: bool
) -> Step:
    """One iteration as one would write it down."""
    network.train()
    optimizer = torch.optim.Adam(network.parameters(), 1e-4)

    def step() -> None:
        predictions = predict()
        loss = torch.zeros(())
        for prediction in predictions:
            truth = nn.functional.adaptive_avg_pool2d(batch.disparity, prediction.shape[-2:])
            loss = loss + (prediction - truth).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        if clip:
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()

    return step


def cpu_seconds(step: Step) -> float:
    began = time.process_time()
    step()
    return time.process_time() - began


def alternate(steps: dict[str, Step], rounds: int) -> dict[str, float]:
    """Median CPU seconds of each, timed in turns after one round of warming up."""
    times: dict[str, list[float]] = {name: [] for name in steps}
    for number in range(rounds + 1):
        for name, step in steps.items():
            seconds = cpu_seconds(step)
            if number > 0:
                times[name].append(seconds)
    return {name: statistics.median(values) for name, values in times.items()}


def gemm_peak() -> float:
    """Floating-point operations a CPU second of a large matrix product."""
    a, b = torch.rand(2, 1536, 1536)
    seconds = alternate({"gemm": lambda: [a @ b for _ in range(4)] and None}, 5)["gemm"]
    return 4 * 2 * 1536**3 / seconds


def convolution_operations(network: nn.Module, run: Callable[[], object]) -> float:
    """Floating-point operations of all convolutions of one iteration: forward, and twice that backward."""
    total = 0.0

    def count(layer: nn.Module, inputs: tuple[Tensor, ...], output: Tensor) -> None:
        nonlocal total
        # A transposed convolution multiplies every input pixel by its kernel, a convolution makes every output so.
        pixels = inputs[0] if isinstance(layer, nn.ConvTranspose2d) else output
        assert isinstance(layer.weight, Tensor)
        total += 2 * pixels.shape[0] * pixels.shape[2] * pixels.shape[3] * layer.weight.numel()

    layers = [m for m in network.modules() if isinstance(m, nn.Conv2d | nn.ConvTranspose2d)]
    hooks = [layer.register_forward_hook(count) for layer in layers]
    with torch.no_grad():
        run()
    for hook in hooks:
        hook.remove()
    return 3 * total


def convolution_share(step: Step, rounds: int = 5) -> float:
    """Share of an iteration's time inside convolutions.

    The median of each operation's time over the rounds, since the profiler measures wall time, in which other
    programs' turns on this core show.
    """
    runs = []
    for _ in range(rounds):
        with profile(activities=[ProfilerActivity.CPU]) as profiler:
            step()
        runs.append([(event.name, event.self_cpu_time_total) for event in profiler.events()])
    everything = inside = 0.0
    for events in zip(*runs, strict=True):
        seconds = statistics.median(time for _, time in events)
        everything += seconds
        inside += seconds if "conv" in events[0][0] else 0.0
    return inside / everything


def fadnet_dispnet(folder: Path) -> nn.Module:
    """FADNet's DispNetC without residual blocks: the network nearest to the original."""
    sys.path.insert(0, str(folder))
    from networks.DispNetC import DispNetC  # type: ignore[import-not-found]

    network: nn.Module = DispNetC(resBlock=False)
    return network


def compare(name: str, crops: int, rounds: int, fadnet: Path | None) -> None:
    """Print one iteration of a preset against its rivals."""
    preset = find_preset("regressor", name, "dispnet")
    assert isinstance(preset, RegressorPreset)
    batch = random_batch(preset, crops)
    clip = preset.optimizer.clip_norm is not None
    task = RegressorTask(preset, build_regressor(preset), preset.steps, 0)
    ours = our_step(task, batch)
    assert isinstance(preset.network, DispNetConfig)
    plain = PlainDispNet(preset.network)
    left, right = batch.left, batch.right
    half = RegressorTask(preset, build_regressor(preset), preset.steps, 0)
    steps = {
        "ours": ours,
        "ours in bf16": our_step(half, batch, bf16=True),
        "plain PyTorch": rival_step(plain, lambda: plain(left, right), batch, clip),
    }
    if fadnet is not None:
        other = fadnet_dispnet(fadnet)
        both = torch.cat([left, right], dim=1)
        steps["FADNet's DispNetC"] = rival_step(other, lambda: list(other(both)), batch, clip)
    operations = convolution_operations(task.network, lambda: task.network(left, right))
    work = dict.fromkeys(steps, operations)
    if fadnet is not None:
        work["FADNet's DispNetC"] = convolution_operations(other, lambda: other(both))
    seconds = alternate(steps, rounds)
    print(f"\n{name}: {crops} crops of {preset.crop_width}x{preset.crop_height}, one thread")
    for rival, value in seconds.items():
        print(
            f"  {rival:20} {value:8.3f} CPU s an iteration  {value / seconds['ours']:5.2f} x ours  "
            f"{work[rival] / 1e9:6.1f} GFLOP in convolutions, {work[rival] / value / 1e9:5.1f} a second"
        )
    share, peak = convolution_share(ours), gemm_peak()
    reached = operations / (share * seconds["ours"])
    print(
        f"  ours: {share:.0%} of the time in convolutions, at {reached / 1e9:.1f} GFLOP/s, {reached / peak:.0%} of the "
        f"{peak / 1e9:.1f} of a matrix product here;\n  with nothing else to do it would be "
        f"{seconds['plain PyTorch'] / (share * seconds['ours']):.2f} times as fast as plain PyTorch"
    )


def measure_preset(task_name: str, network: str, name: str, crops: int, iterations: int) -> None:
    """Print one preset's speed and the peak memory of this process, which does nothing else."""
    preset, regressor = find_preset(task_name, name, network), find_preset("regressor", name, network)
    assert isinstance(regressor, RegressorPreset)
    step = our_step(build_task(preset, regressor), random_batch(preset, crops))
    step()
    began, cpu = time.perf_counter(), time.process_time()
    for _ in range(iterations):
        step()
    wall, cpu = (time.perf_counter() - began) / iterations, (time.process_time() - cpu) / iterations
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(
        f"{task_name:14}{network:12}{name:6}{crops} x {preset.crop_width}x{preset.crop_height:<6}{1 / wall:8.2f} it/s  "
        f"{cpu:8.3f} CPU s/it  {memory:5.2f} GiB",
        flush=True,
    )


def presets(names: list[str], iterations: int, full_crops: int) -> None:
    """Each preset in a process of its own; not `joint`, whose solves take as long as the pictures want
    (`benchmarks.differentiable`)."""
    context = multiprocessing.get_context("spawn")
    tasks = [("regressor", network, kinds) for network, kinds in REGRESSOR_PRESETS.items()]
    tasks += [(task_name, "dispnet", kinds) for task_name, kinds in PRESETS.items() if task_name != "joint"]
    for task_name, network, kinds in tasks:
        for name in (name for name in names if name in kinds):
            crops = full_crops if name == "full" else kinds[name].batch_size
            settings = (task_name, network, name, crops, iterations)
            process = context.Process(target=measure_preset, args=settings)
            process.start()
            process.join()


def data(folder: str, batches: int) -> None:
    """Print what the pipeline delivers on one core against what training `small` takes there."""
    torch.set_num_threads(1)
    preset = find_preset("regressor", "small", "dispnet")
    sources, _ = open_sources([(folder, 1.0)], (preset.crop_height, preset.crop_width))
    module = StereoDataModule(sources, [], replace(preset, validation_interval=batches), batches, 0)
    loader = iter(module.block(0))
    next(loader)
    began = time.process_time()
    for _ in range(batches - 1):
        next(loader)
    crop = (time.process_time() - began) / ((batches - 1) * preset.batch_size)
    assert isinstance(preset, RegressorPreset)
    batch = random_batch(preset, preset.batch_size)
    step = our_step(RegressorTask(preset, build_regressor(preset), preset.steps, 0), batch)
    training = alternate({"step": step}, 7)["step"] / preset.batch_size
    print(
        f"pipeline {1 / crop:.0f} crops a CPU second, `small` takes {1 / training:.0f}: {training / crop:.1f} x"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    speed = commands.add_parser("presets")
    speed.add_argument("--names", nargs="+", default=["tiny", "small", "full"])
    speed.add_argument("--iterations", type=int, default=5)
    speed.add_argument(
        "--full-crops", type=int, default=1, help="crops a step of the full presets (theirs: 4)"
    )
    pipeline = commands.add_parser("data")
    pipeline.add_argument("--data", required=True)
    pipeline.add_argument("--batches", type=int, default=100)
    rivals = commands.add_parser("rivals")
    rivals.add_argument("--fadnet", type=Path)
    rivals.add_argument("--names", nargs="+", default=["small", "full"])
    rivals.add_argument("--rounds", type=int, default=5)
    rivals.add_argument(
        "--full-crops", type=int, default=1, help="crops a step of the full preset (its own: 4)"
    )
    arguments = parser.parse_args()
    if arguments.command == "presets":
        presets(arguments.names, arguments.iterations, arguments.full_crops)
    elif arguments.command == "data":
        data(arguments.data, arguments.batches)
    else:
        torch.set_num_threads(1)
        for name in arguments.names:
            crops = (
                arguments.full_crops
                if name == "full"
                else find_preset("regressor", name, "dispnet").batch_size
            )
            compare(name, crops, arguments.rounds, arguments.fadnet)


if __name__ == "__main__":
    main()

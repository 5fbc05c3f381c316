"""The same scenes rendered by BlenderProc and by StereoForge: pairs an hour, quality, memory, start-up.

    python -m benchmarks.against_blenderproc --blenderproc-python PATH [--scenes 8] [--size 480x270] [--out DIR]

Scenes of flying_things with 30 objects. BlenderProc is given each as a .blend file of what StereoForge built, so it
neither samples nor paints nor makes meshes, and it renders pictures and depth only; StereoForge runs as it always does:
it samples, builds, renders, makes all ground truth and writes a checked data set. Three settings of BlenderProc:

    chosen    StereoForge's settings of Cycles, some of which take Blender's own interface
    api       those of them that BlenderProc's functions can set, so with its own denoiser; --api-samples
    shipped   as it comes: up to 1024 samples, its own denoiser

The first two as one process a core with one thread each, the last as one process with all cores.

PATH is a Python 3.11 with bpy and what docs/tutorials/bpy_module.md of BlenderProc lists, and a clone of BlenderProc
on its path: the release 2.8.0 cannot use a bpy from outside yet. PSNR is of the developed left pictures, against
`--reference-samples` without denoiser, over the first `--quality-scenes`. References and .blend files stay in --out.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from benchmarks.render import WorkerMemory
from datagen import Recipe
from datagen.blender.build import build_world, place
from datagen.blender.camera import render_view
from datagen.blender.session import CyclesSettings, quiet, start_empty_file
from datagen.dataset.layout import Layout
from datagen.dataset.manifest import read_manifest
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.recipe.curation import Curation
from datagen.recipe.recipe import write_recipe
from datagen.rendering.exposure import automatic_exposure, develop
from scenes import FAMILIES, Scene

SETTINGS = ("chosen", "api", "shipped")
SAMPLES = 4


@dataclass(frozen=True)
class Run:
    """What one way of rendering the scenes came to."""

    name: str
    scenes: int
    seconds: float
    """Of the whole run, start-up included."""
    start_up: float
    steps: dict[str, float]
    """Median seconds a scene."""
    psnr: float
    memory_mb: tuple[float, float]
    """Peaks of the largest process, in the first and in the second half of the run."""


def recipe_of(scenes: int, width: int, height: int) -> Recipe:
    world = FAMILIES["flying_things"].config(
        width=width, height=height, flying_objects=(9, 9), background_objects=(20, 20)
    )
    return Recipe(world, {"train": scenes}, samples=SAMPLES, curation=Curation(enabled=False))


def hand_over(scene: Scene, path: Path) -> None:
    """Save a scene as StereoForge builds it, pictures included, as a .blend file."""
    with quiet(path.with_suffix(".log")):
        place(build_world(build_geometry(scene), start_empty_file(CyclesSettings())), "left", 0.0)
        for image in bpy.data.images:
            image.pack()
        bpy.ops.wm.save_as_mainfile(filepath=str(path))


def camera_of(scene: Scene) -> dict[str, object]:
    camera = scene.camera
    return {
        "width": camera.width,
        "height": camera.height,
        "focal_mm": camera.focal_mm,
        "sensor_width_mm": camera.sensor_width_mm,
        "baseline_m": camera.baseline_m,
        "pose": camera.pose("left", 0.0).tolist(),
    }


def left_radiance(scene: Scene, samples: int, denoise: bool, scratch: Path) -> NDArray[np.float32]:
    with quiet(scratch / "blender.log"):
        world = build_world(
            build_geometry(scene), start_empty_file(CyclesSettings(samples, threads=os.cpu_count() or 1))
        )
        world.blender_scene.cycles.use_denoising = denoise
        return render_view(world, "left", 0, scratch)


def prepare(recipe: Recipe, quality_scenes: int, reference_samples: int, out: Path) -> None:
    """The .blend files, cameras and references, unless they are there."""
    folder = out / "scenes"
    folder.mkdir(parents=True, exist_ok=True)
    sampled = [recipe.sample("train", number) for number in range(recipe.scenes["train"])]
    (folder / "cameras.json").write_text(json.dumps([camera_of(scene) for scene in sampled]))
    for number, scene in enumerate(sampled):
        if not (folder / f"{number:04d}.blend").exists():
            hand_over(scene, folder / f"{number:04d}.blend")
        reference = folder / f"{number:04d}.npy"
        if number < quality_scenes and not reference.exists():
            np.save(reference, left_radiance(scene, reference_samples, False, folder))


def quality(pictures: list[NDArray[np.float32]], recipe: Recipe, out: Path) -> float:
    """Mean PSNR (dB) of left radiances, (H, W, 3) each, developed as their references are."""
    values = []
    for number, radiance in enumerate(pictures):
        reference = np.load(out / "scenes" / f"{number:04d}.npy")
        exposure = automatic_exposure(reference, recipe.sample("train", number).exposure_key)
        error = develop(radiance, exposure).astype(float) - develop(reference, exposure)
        values.append(10 * np.log10(255**2 / np.mean(error**2)))
    return float(np.mean(values))


def peaks(memory: WorkerMemory) -> tuple[float, float]:
    largest = max(memory.megabytes.values(), key=max)
    half = max(1, len(largest) // 2)
    return max(largest[:half]), max(largest[half:] or largest)


def run_ours(recipe: Recipe, quality_scenes: int, out: Path) -> Run:
    with tempfile.TemporaryDirectory() as folder:
        memory = WorkerMemory()
        memory.start()
        write_recipe(out / "recipe.yaml", recipe)
        command = [
            sys.executable,
            "-m",
            "stereoforge",
            "render",
            "--recipe",
            out / "recipe.yaml",
            "--out",
            folder,
        ]
        started = time.monotonic()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        seconds = time.monotonic() - started
        memory.stop()
        layout = Layout(Path(folder))
        manifests = [read_manifest(layout.manifest("train", n)) for n in layout.committed_scenes("train")]
    started = time.monotonic()
    code = "from datagen.blender.session import *; start_empty_file(CyclesSettings())"
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
    start_up = time.monotonic() - started
    radiances = [
        left_radiance(recipe.sample("train", number), SAMPLES, True, out / "scenes")
        for number in range(quality_scenes)
    ]
    return Run(
        "StereoForge",
        len(manifests),
        seconds,
        start_up,
        {step: float(np.median([m.seconds[step] for m in manifests])) for step in manifests[0].seconds},
        quality(radiances, recipe, out),
        peaks(memory),
    )


def run_blenderproc(
    setting: str, samples: int, python: Path, recipe: Recipe, scenes: int, quality_scenes: int, out: Path
) -> Run:
    shares = 1 if setting == "shipped" else os.cpu_count() or 1
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        memory = WorkerMemory()
        memory.start()
        started, started_at = time.monotonic(), time.time()
        processes = [
            subprocess.Popen(
                [
                    *(python, Path(__file__).with_name("blenderproc_scenes.py")),
                    *(out / "scenes", folder, "--setting", setting, "--samples", str(samples)),
                    *("--count", str(scenes), "--share", f"{share}/{shares}"),
                ],
                env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
                | {"USE_EXTERNAL_BPY_MODULE": "1"},
                stdout=subprocess.PIPE,
                text=True,
            )
            for share in range(shares)
        ]
        results = [_results(process) for process in processes]
        seconds = time.monotonic() - started
        memory.stop()
        radiances = [
            _left_picture(python, folder / f"{number:04d}" / "0.hdf5")
            for number in range(min(quality_scenes, scenes))
        ]
    scenes_of = [scene for result in results for scene in result[1:]]
    return Run(
        f"BlenderProc, {setting}" + (f", {samples} samples" if setting == "api" else ""),
        scenes,
        seconds,
        max(result[0]["ready_at"] for result in results) - started_at,
        {step: float(np.median([s["seconds"][step] for s in scenes_of])) for step in scenes_of[0]["seconds"]},
        quality(radiances, recipe, out),
        peaks(memory),
    )


def _results(process: subprocess.Popen[str]) -> list[dict]:
    printed, _ = process.communicate()
    if process.returncode:
        raise SystemExit(f"BlenderProc failed: {printed[-2000:]}")
    return [json.loads(line.split(" ", 1)[1]) for line in printed.splitlines() if line.startswith("RESULT ")]


def _left_picture(python: Path, path: Path) -> NDArray[np.float32]:
    """(H, W, 3) radiance of the left view. HDF5 is read by BlenderProc's Python: ours has no use for it."""
    code = (
        "import h5py, numpy, sys; colors = numpy.asarray(h5py.File(sys.argv[1])['colors'], 'f4'); "
        "numpy.save(sys.argv[2], colors[0])"
    )
    subprocess.run([python, "-c", code, path, path.with_suffix(".npy")], check=True)
    return np.load(path.with_suffix(".npy"))


def report(runs: list[Run]) -> None:
    print(
        "\n| | scenes | pairs an hour, whole run | the same without start-up | start-up, s | PSNR, dB | peak memory "
        "of a process, first and second half of the run, MB | a scene, s |\n|---|---|---|---|---|---|---|---|"
    )
    for run in runs:
        steps = ", ".join(f"{step} {seconds:.2f}" for step, seconds in run.steps.items())
        first, last = run.memory_mb
        print(
            f"| {run.name} | {run.scenes} | {run.scenes / run.seconds * 3600:.0f} | "
            f"{run.scenes / max(run.seconds - run.start_up, 1e-9) * 3600:.0f} | {run.start_up:.1f} | "
            f"{run.psnr:.2f} | {first:.0f}, {last:.0f} | {steps} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--blenderproc-python", type=Path, required=True)
    parser.add_argument("--scenes", type=int, default=8)
    parser.add_argument(
        "--shipped-scenes", type=int, default=1, help="how many with the slow `shipped` setting"
    )
    parser.add_argument("--quality-scenes", type=int, default=2)
    parser.add_argument("--size", default="480x270")
    parser.add_argument("--reference-samples", type=int, default=256)
    parser.add_argument("--settings", nargs="+", default=SETTINGS, choices=SETTINGS)
    parser.add_argument("--api-samples", type=int, nargs="+", default=(SAMPLES, 2 * SAMPLES))
    parser.add_argument("--prepare-only", action="store_true")
    parser.add_argument("--out", type=Path, help="where scenes and references stay; else a temporary folder")
    arguments = parser.parse_args()
    recipe = recipe_of(arguments.scenes, *map(int, arguments.size.split("x")))
    with tempfile.TemporaryDirectory() as temporary:
        out = (arguments.out or Path(temporary)).absolute()
        prepare(recipe, arguments.quality_scenes, arguments.reference_samples, out)
        if arguments.prepare_only:
            return
        runs = [run_ours(recipe, arguments.quality_scenes, out)]
        for setting in arguments.settings:
            for samples in arguments.api_samples if setting == "api" else (SAMPLES,):
                runs.append(
                    run_blenderproc(
                        setting,
                        samples,
                        arguments.blenderproc_python,
                        recipe,
                        arguments.shipped_scenes if setting == "shipped" else arguments.scenes,
                        arguments.quality_scenes,
                        out,
                    )
                )
                report(runs)


if __name__ == "__main__":
    main()

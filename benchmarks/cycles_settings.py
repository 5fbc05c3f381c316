"""What Cycles' settings cost and give: CPU seconds a view and PSNR to a reference of many samples.

    python benchmarks/cycles_settings.py [--scenes 6] [--width 480] [--height 270] [--reference-samples 256]

Every setting renders the same views in the same process, one thread, settings in turn within each scene, so that a
loaded machine slows all of them alike. PSNR is that of the developed 8-bit pictures, which is what networks see.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.blender.build import build_world
from datagen.blender.camera import render_view
from datagen.blender.session import CyclesSettings, quiet, start_empty_file
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.rendering.exposure import automatic_exposure, develop
from scenes import FAMILIES, Scene, sample_scene


@dataclass(frozen=True)
class Variant:
    """The shipped settings with some of them changed."""

    name: str
    samples: int = 4
    cycles: dict[str, Any] = field(default_factory=dict)
    """Attributes of `scene.cycles`."""
    world: dict[str, Any] = field(default_factory=dict)
    """Attributes of `scene.world.cycles`."""


FEW_BOUNCES = {"max_bounces": 1, "diffuse_bounces": 1, "glossy_bounces": 1}
VARIANTS = (
    Variant("shipped: 4 samples, FAST denoiser"),
    Variant("1 sample", 1),
    Variant("2 samples", 2),
    Variant("8 samples", 8),
    Variant("16 samples", 16),
    Variant("no denoiser", cycles={"use_denoising": False}),
    Variant("16 samples, no denoiser", 16, {"use_denoising": False}),
    Variant(
        "denoiser HIGH, prefilter ACCURATE",
        cycles={"denoising_quality": "HIGH", "denoising_prefilter": "ACCURATE"},
    ),
    Variant("denoiser BALANCED", cycles={"denoising_quality": "BALANCED"}),
    Variant("denoiser sees colour only", cycles={"denoising_input_passes": "RGB"}),
    Variant("one bounce", cycles=FEW_BOUNCES),
    Variant("no light tree", cycles={"use_light_tree": False}),
    Variant("sky not sampled as a light", world={"sampling_method": "NONE"}),
    Variant(
        "no light tree, sky not sampled", cycles={"use_light_tree": False}, world={"sampling_method": "NONE"}
    ),
    Variant("ambient occlusion for indirect light", cycles={"use_fast_gi": True, "ao_bounces_render": 1}),
    Variant("light threshold 0.05", cycles={"light_sampling_threshold": 0.05}),
)


def render(scene: Scene, variant: Variant, scratch: Path) -> tuple[NDArray[np.float32], float]:
    """Linear radiance of the left view at the first frame, and the CPU seconds it took once the world stood."""
    with quiet(scratch / "blender.log"):
        blender_scene = start_empty_file(CyclesSettings(samples=variant.samples))
        world = build_world(build_geometry(scene), blender_scene)
        for owner, changes in (
            (blender_scene.cycles, variant.cycles),
            (blender_scene.world.cycles, variant.world),
        ):
            for name, value in changes.items():
                setattr(owner, name, value)
        render_view(world, "right", 0, scratch)  # builds the acceleration structures all views share
        started = time.process_time()
        radiance = render_view(world, "left", 0, scratch)
        return radiance, time.process_time() - started


def psnr(picture: NDArray[np.uint8], reference: NDArray[np.uint8]) -> float:
    return float(10 * np.log10(255**2 / np.mean((picture.astype(float) - reference) ** 2)))


def measure(scene: Scene, reference_samples: int, scratch: Path) -> dict[str, tuple[float, float]]:
    """(CPU seconds, PSNR) of every variant on one scene."""
    truth, _ = render(scene, Variant("reference", reference_samples, {"use_denoising": False}), scratch)
    exposure = automatic_exposure(truth, scene.exposure_key)
    reference = develop(truth, exposure)
    results = {}
    for variant in VARIANTS:
        radiance, seconds = render(scene, variant, scratch)
        results[variant.name] = seconds, psnr(develop(radiance, exposure), reference)
        print(f"  {variant.name}: {seconds:.2f} s, {results[variant.name][1]:.2f} dB", flush=True)
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--family", default="flying_things", choices=sorted(FAMILIES))
    parser.add_argument("--scenes", type=int, default=6)
    parser.add_argument("--width", type=int, default=480)
    parser.add_argument("--height", type=int, default=270)
    parser.add_argument("--reference-samples", type=int, default=256)
    arguments = parser.parse_args()
    config = FAMILIES[arguments.family].config(width=arguments.width, height=arguments.height)
    runs = []
    with tempfile.TemporaryDirectory() as scratch:
        for seed in range(arguments.scenes):
            print(f"scene {seed}", flush=True)
            scene = sample_scene(np.random.default_rng(1000 + seed), arguments.family, config)
            runs.append(measure(scene, arguments.reference_samples, Path(scratch)))
    base = VARIANTS[0].name
    print("\n| setting | CPU s a view (median) | of the shipped | PSNR, dB (mean) |\n|---|---|---|---|")
    for variant in VARIANTS:
        seconds = [run[variant.name][0] for run in runs]
        ratio = np.median([run[variant.name][0] / run[base][0] for run in runs])
        quality = np.mean([run[variant.name][1] for run in runs])
        print(f"| {variant.name} | {np.median(seconds):.2f} | {ratio:.2f} | {quality:.2f} |")


if __name__ == "__main__":
    main()

"""What Cycles' settings cost and give: CPU seconds a view and PSNR to a reference of many samples.

    python benchmarks/cycles_settings.py [--scenes 6] [--width 480] [--height 270] [--reference-samples 256]

Every setting renders the same views in the same process, one thread, settings in turn within each scene, so that a
loaded machine slows all of them alike. The seconds are those of the second view and, with building, of the first.
PSNR is that of the developed 8-bit pictures, which is what networks see.
"""

from __future__ import annotations

import argparse
import functools
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
    changes: dict[str, Any] = field(default_factory=dict)
    """Settings by their names in Blender's scene, such as `cycles.max_bounces`."""


FEW_BOUNCES = {"cycles.max_bounces": 1, "cycles.diffuse_bounces": 1, "cycles.glossy_bounces": 1}
VARIANTS = (
    Variant("shipped: 4 samples, FAST denoiser"),
    Variant("1 sample", 1),
    Variant("2 samples", 2),
    Variant("8 samples", 8),
    Variant("16 samples", 16),
    Variant("no denoiser", changes={"cycles.use_denoising": False}),
    Variant("16 samples, no denoiser", 16, {"cycles.use_denoising": False}),
    Variant(
        "denoiser HIGH, prefilter ACCURATE",
        changes={"cycles.denoising_quality": "HIGH", "cycles.denoising_prefilter": "ACCURATE"},
    ),
    Variant("denoiser BALANCED", changes={"cycles.denoising_quality": "BALANCED"}),
    Variant("denoiser sees colour only", changes={"cycles.denoising_input_passes": "RGB"}),
    Variant("one bounce", changes=FEW_BOUNCES),
    Variant("no light tree", changes={"cycles.use_light_tree": False}),
    Variant("sky not sampled as a light", changes={"world.cycles.sampling_method": "NONE"}),
    Variant(
        "no light tree, sky not sampled",
        changes={"cycles.use_light_tree": False, "world.cycles.sampling_method": "NONE"},
    ),
    Variant(
        "ambient occlusion for indirect light",
        changes={"cycles.use_fast_gi": True, "cycles.ao_bounces_render": 1},
    ),
    Variant("light threshold 0.05", changes={"cycles.light_sampling_threshold": 0.05}),
    Variant("BVH with spatial splits", changes={"cycles.debug_use_spatial_splits": True}),
    Variant("BVH not compact", changes={"cycles.debug_use_compact_bvh": False}),
    Variant("BVH2 in place of Embree", changes={"cycles.debug_bvh_layout": "BVH2"}),
    Variant("tiles of 64 px", changes={"cycles.use_auto_tile": True, "cycles.tile_size": 64}),
    Variant("textures of 1024 px at most", changes={"cycles.texture_limit_render": "1024"}),
    Variant("nothing kept between the views", changes={"render.use_persistent_data": False}),
)


@dataclass(frozen=True)
class Rendered:
    """The left view at the first frame, and what it cost."""

    radiance: NDArray[np.float32]
    """(H, W, 3), linear."""
    first: float
    """CPU seconds of the right view, which comes first, and of handing the world to Blender."""
    second: float
    """CPU seconds of the left view, once the world stands."""


def render(scene: Scene, variant: Variant, scratch: Path) -> Rendered:
    """Build the world and render both views, the left one last."""
    with quiet(scratch / "blender.log"):
        started = time.process_time()
        blender_scene = start_empty_file(CyclesSettings(samples=variant.samples))
        world = build_world(build_geometry(scene), blender_scene)
        for name, value in variant.changes.items():
            *path, attribute = name.split(".")
            setattr(functools.reduce(getattr, path, blender_scene), attribute, value)
        render_view(world, "right", 0, scratch)
        stands = time.process_time()
        radiance = render_view(world, "left", 0, scratch)
        return Rendered(radiance, stands - started, time.process_time() - stands)


def psnr(picture: NDArray[np.uint8], reference: NDArray[np.uint8]) -> float:
    return float(10 * np.log10(255**2 / np.mean((picture.astype(float) - reference) ** 2)))


@dataclass(frozen=True)
class Cost:
    """What a variant costs and gives on one scene."""

    first: float
    second: float
    """As in `Rendered`."""
    psnr: float
    """Of the left view, dB."""


def measure(scene: Scene, reference_samples: int, scratch: Path) -> dict[str, Cost]:
    """Every variant on one scene, by its name."""
    plain = Variant("reference", reference_samples, {"cycles.use_denoising": False})
    truth = render(scene, plain, scratch).radiance
    exposure = automatic_exposure(truth, scene.exposure_key)
    reference = develop(truth, exposure)
    results = {}
    for variant in VARIANTS:
        found = render(scene, variant, scratch)
        cost = Cost(found.first, found.second, psnr(develop(found.radiance, exposure), reference))
        results[variant.name] = cost
        print(f"  {variant.name}: {cost.first:.2f} and {cost.second:.2f} s, {cost.psnr:.2f} dB", flush=True)
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
    print("\n| setting | building and first view, CPU s | second view | of the shipped | PSNR, dB |")
    print("|---|---|---|---|---|")
    for variant in VARIANTS:
        costs = [run[variant.name] for run in runs]
        ratio = np.median([run[variant.name].second / run[base].second for run in runs])
        first, second = np.median([(cost.first, cost.second) for cost in costs], axis=0)
        quality = np.mean([cost.psnr for cost in costs])
        print(f"| {variant.name} | {first:.2f} | {second:.2f} | {ratio:.2f} | {quality:.2f} |")


if __name__ == "__main__":
    main()

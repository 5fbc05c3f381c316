"""Renders the .blend files of `benchmarks.against_blenderproc` with BlenderProc, in BlenderProc's own Python.

    USE_EXTERNAL_BPY_MODULE=1 python blenderproc_scenes.py SCENES OUT --setting shipped|api|chosen

What its users do in a loop: clean up, load, place the camera, render both eyes with depth, write HDF5. Prints when it
was ready for the first scene, and the seconds of each step of every scene.
"""

import argparse
import json
import math
import time
from pathlib import Path

import blenderproc as bproc
import bpy


def choose_with_its_api(samples: int) -> None:
    """As StereoForge's, so far as BlenderProc's own functions go: all but the denoiser's quality and what is kept."""
    bproc.renderer.set_max_amount_of_samples(samples)
    bproc.renderer.set_noise_threshold(0)
    bproc.renderer.set_cpu_threads(1)
    bproc.renderer.toggle_light_tree(True)
    bproc.renderer.set_light_bounces(
        diffuse_bounces=2,
        glossy_bounces=2,
        ao_bounces_render=0,
        max_bounces=4,
        transmission_bounces=4,
    )


def choose_with_blender_too(samples: int) -> None:
    """The settings StereoForge ships, those included that only Blender's own interface offers."""
    choose_with_its_api(samples)
    bproc.renderer.set_denoiser(None)
    scene = bpy.context.scene
    scene.render.use_persistent_data = True
    cycles = scene.cycles
    cycles.use_denoising = True
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = cycles.denoising_quality = "FAST"
    bpy.context.view_layer.cycles.use_denoising = True
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 4.0


def set_up(camera: dict) -> None:
    """What holds for all scenes: one camera's optics, depth, and pictures with their whole range."""
    field_of_view = 2 * math.atan(camera["sensor_width_mm"] / 2 / camera["focal_mm"])
    bproc.camera.set_intrinsics_from_blender_params(
        field_of_view, camera["width"], camera["height"], clip_start=1e-3, clip_end=1e7, lens_unit="FOV"
    )
    bproc.camera.set_stereo_parameters(
        interocular_distance=camera["baseline_m"], convergence_mode="PARALLEL", convergence_distance=1e-5
    )
    bproc.renderer.toggle_stereo(True)
    bproc.renderer.enable_depth_output(activate_antialiasing=False)
    bproc.renderer.set_output_format("OPEN_EXR", 32, view_transform="Raw")


def render_one(path: Path, camera: dict, out: Path) -> dict:
    """One scene from its .blend to its HDF5; the seconds of each step."""
    times = [time.time()]
    bproc.clean_up(clean_up_camera=False)
    times.append(time.time())
    bproc.loader.load_blend(str(path), obj_types=["mesh", "light"], data_blocks=["objects", "worlds"])
    bpy.context.scene.world = bpy.data.worlds["environment"]
    bproc.camera.add_camera_pose(camera["pose"])
    times.append(time.time())
    data = bproc.renderer.render()
    times.append(time.time())
    bproc.writer.write_hdf5(str(out), data, append_to_existing_output=True)
    times.append(time.time())
    steps = ("clean_up", "load", "render", "write")
    return {step: end - start for step, start, end in zip(steps, times, times[1:], strict=False)}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("scenes", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--setting", choices=("shipped", "api", "chosen"), required=True)
    parser.add_argument("--samples", type=int, default=4)
    parser.add_argument("--count", type=int, required=True)
    parser.add_argument("--share", default="0/1", help="I/N: scenes I, I + N, ...")
    arguments = parser.parse_args()
    first, step = map(int, arguments.share.split("/"))
    bproc.init()
    if arguments.setting == "api":
        choose_with_its_api(arguments.samples)
    elif arguments.setting == "chosen":
        choose_with_blender_too(arguments.samples)
    cameras = json.loads((arguments.scenes / "cameras.json").read_text())
    set_up(cameras[0])
    print("RESULT", json.dumps({"ready_at": time.time()}), flush=True)
    for number in range(first, arguments.count, step):
        out = arguments.out / f"{number:04d}"
        seconds = render_one(arguments.scenes / f"{number:04d}.blend", cameras[number], out)
        print("RESULT", json.dumps({"seconds": seconds}), flush=True)


main()

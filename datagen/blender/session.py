"""Blender's global state: the empty file, Cycles' settings, and its output, which goes to a log."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy


@dataclass(frozen=True)
class CyclesSettings:
    """The settings of the picture's rendering. Ground truth does not depend on them."""

    samples: int = 4
    """Paths per pixel; the denoiser makes 4 look clean."""
    device: str = "cpu"
    """`cpu`, `cuda`, `optix`, `hip` or `metal`."""
    threads: int = 1
    """CPU threads that this process may use."""


def blender_version() -> str:
    """The version of Blender's library, such as 4.5.15 LTS."""
    return str(bpy.app.version_string)


@contextlib.contextmanager
def quiet(log: Path) -> Iterator[None]:
    """Append everything that the process prints, from Blender's C code too, to a file."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    target = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.dup2(target, 1)
        os.dup2(target, 2)
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os.dup2(saved[0], 1)
        os.dup2(saved[1], 2)
        for descriptor in (*saved, target):
            os.close(descriptor)


def start_empty_file(settings: CyclesSettings) -> bpy.types.Scene:
    """Open an empty file and return its scene, set up to render the clean pass with Cycles.

    An empty file for each scene keeps the memory of a long-lived worker flat. Raises RuntimeError if Cycles finds no
    such device.
    """
    # The preferences are those of the start: reading them again registers every add-on anew, six times as slow.
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    _configure_cycles(scene, settings)
    _configure_output(scene)
    return scene


bpy.ops.wm.read_factory_settings(use_empty=True)  # Whatever preferences this user has for Blender.


def _configure_cycles(scene: bpy.types.Scene, settings: CyclesSettings) -> None:
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    _choose_device(scene, settings.device)
    scene.render.threads_mode = "FIXED"
    scene.render.threads = settings.threads
    cycles.samples = settings.samples
    # Adaptive sampling would stop pixels early by noise; with a handful of samples it only adds a pass.
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = True
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    # Accurate prefiltering and high quality cost ten seconds a frame and are hardly visible.
    cycles.denoising_prefilter = "FAST"
    cycles.denoising_quality = "FAST"
    cycles.max_bounces = 4
    cycles.diffuse_bounces = 2
    cycles.glossy_bounces = 2
    cycles.transmission_bounces = 4
    cycles.caustics_reflective = False
    cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 4.0
    # Both views and all frames show the same world: keep its images and acceleration structures.
    scene.render.use_persistent_data = True


def finds_device(device: str) -> bool:
    """Whether Cycles can compute on this machine's `cpu`, or finds a `cuda`, `optix`, `hip` or `metal` device."""
    return device == "cpu" or bool(_cycles_preferences().get_devices_for_type(device.upper()))


def _choose_device(scene: bpy.types.Scene, device: str) -> None:
    if device == "cpu":
        scene.cycles.device = "CPU"
        return
    if not finds_device(device):
        raise RuntimeError(f"Blender finds no {device} device on this machine")
    preferences = _cycles_preferences()
    preferences.compute_device_type = device.upper()
    preferences.get_devices()
    for item in preferences.devices:
        item.use = item.type == device.upper()
    scene.cycles.device = "GPU"


def _cycles_preferences() -> bpy.types.AddonPreferences:
    return bpy.context.preferences.addons["cycles"].preferences


def _configure_output(scene: bpy.types.Scene) -> None:
    image = scene.render.image_settings
    if hasattr(image, "media_type"):  # Blender 5: the kind of file comes before its format.
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth = "32"
    image.exr_codec = "NONE"
    scene.view_layers[
        0
    ].use_pass_z = False  # Ground truth comes from the geometry (`datagen.ground_truth.raycast`).
    scene.render.use_compositing = False
    scene.render.use_sequencer = False
    scene.render.film_transparent = False
    scene.render.resolution_percentage = 100
    scene.render.use_file_extension = False

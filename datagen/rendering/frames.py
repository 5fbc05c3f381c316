"""A Scene to arrays: both eyes' pictures and exact ground truth, frame by frame."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import EYES, Direction, Eye
from datagen.ground_truth.labels import forward_differences, gradient_validity
from datagen.ground_truth.raycast import Hits, SceneRayCaster
from datagen.ground_truth.scene_geometry import SceneGeometry
from datagen.ground_truth.targets import ExtraTargets
from datagen.rendering.exposure import automatic_exposure, develop
from datagen.rendering.sensor import Sensor
from scenes import Scene
from stereoforge_kit.errors import UserError
from stereoforge_kit.processes import captured_output

BLENDER_LOG = "blender.log"
LOG_LINES_SHOWN = 5


@dataclass(frozen=True)
class EyeTargets:
    """One eye's pictures and ground truth, as they are stored."""

    images: dict[str, NDArray[np.uint8]]
    """(H, W, 3) sRGB of each pass, by its name."""
    disparity: NDArray[np.float32]
    """(H, W) px."""
    gradient: NDArray[np.float32]
    """(H, W, 2) forward differences [dx, dy] of the disparity."""
    gradient_valid: NDArray[np.bool_]
    """(H, W)."""
    occlusion: NDArray[np.uint8]
    """(H, W) 0 visible, 1 occluded, 2 out of the other frame."""
    object_index: NDArray[np.uint16]
    """(H, W) 0 where nothing is hit, else 1 + the index in `Scene.objects`."""
    extra: dict[tuple[str, Direction | None], NDArray[Any]]
    """The targets asked for besides, by kind and direction."""


@dataclass(frozen=True)
class RenderOptions:
    """How a Scene becomes arrays."""

    samples: int = 4
    """Paths a pixel; ground truth is exact whatever this is."""
    device: str = "cpu"
    threads: int = 1
    gradient_threshold_px: float = 1.0
    """Larger forward differences are discontinuities: invalid as gradient targets."""
    targets: tuple[str, ...] = ()
    """Which of `EXTRA_TARGETS` to make."""
    passes: tuple[str, ...] = ("clean",)
    """Which of `RENDER_PASSES` to make."""


@dataclass
class Stopwatch:
    """Wall seconds by step."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 4)


class BlenderError(UserError):
    """Blender could not render a scene; the message carries the end of its log."""


def render_frames(
    scene: Scene,
    scratch: Path,
    options: RenderOptions | None = None,
    watch: Stopwatch | None = None,
    caster: SceneRayCaster | None = None,
) -> Generator[tuple[int, dict[Eye, EyeTargets]], None, None]:
    """Yield (frame, both eyes' arrays) for every frame of a scene, frames counted from 0.

    scratch: an existing folder for Blender's temporary files and, outside worker processes, its log.
    caster: at the scene's meshes, if they have been built already. Blender keeps one world a process, so one
    iterator at a time. Raises BlenderError, and RuntimeError on a Python without bpy.
    """
    # Imported here so that planning, verifying and training work on a Python without Blender.
    from datagen.blender.build import build_world
    from datagen.blender.camera import render_view
    from datagen.blender.final_pass import render_final
    from datagen.blender.session import CyclesSettings, quiet, start_empty_file

    options, watch = options or RenderOptions(), watch or Stopwatch()
    log = captured_output() or scratch / BLENDER_LOG
    exposure: float | None = None
    try:
        with watch.step("build"), quiet(log):
            caster = caster or SceneRayCaster(SceneGeometry(scene))
            settings = CyclesSettings(options.samples, options.device, options.threads)
            world = build_world(caster.geometry, start_empty_file(settings))
        sensor = Sensor(scene)
        extra_targets = ExtraTargets(caster, options.targets)
        for frame in range(scene.frames):
            with watch.step("render"), quiet(log):
                views = {eye: render_view(world, eye, frame, scratch) for eye in EYES}
            if exposure is None:  # One exposure a scene: a camera does not flicker.
                exposure = automatic_exposure(views["left"], scene.exposure_key)
            images = {eye: {"clean": develop(radiance, exposure)} for eye, radiance in views.items()}
            if "final" in options.passes:
                with watch.step("render_final"), quiet(log):
                    for eye, radiance in render_final(world, frame, exposure, scratch).items():
                        light = sensor.expose(radiance, exposure, eye, frame)
                        images[eye]["final"] = develop(light, 1.0)
            with watch.step("ground_truth"):
                targets = {}
                for eye in EYES:
                    hits = caster.cast_all(eye, frame)
                    chosen = {name: images[eye][name] for name in options.passes}
                    extra = extra_targets.make(eye, frame, hits.object_index)
                    targets[eye] = _targets(chosen, hits, options.gradient_threshold_px, extra)
            yield frame, targets
    except RuntimeError as error:
        tail = " | ".join(log.read_text(errors="replace").splitlines()[-LOG_LINES_SHOWN:])
        raise BlenderError(f"{error}; Blender's last words: {tail}" if tail else str(error)) from error


def _targets(
    images: dict[str, NDArray[np.uint8]],
    hits: Hits,
    gradient_threshold_px: float,
    extra: dict[tuple[str, Direction | None], NDArray[Any]],
) -> EyeTargets:
    disparity = hits.disparity.astype(np.float32)
    gradient = forward_differences(disparity)
    return EyeTargets(
        images,
        disparity,
        gradient,
        gradient_validity(gradient, gradient_threshold_px),
        hits.occlusion,
        hits.object_index.astype(np.uint16),
        extra,
    )

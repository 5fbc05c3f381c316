"""From a Scene to arrays: both views' pictures and exact ground truth, frame by frame."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import VIEWS, Direction, View
from datagen.ground_truth.labels import forward_differences, gradient_validity
from datagen.ground_truth.raycast import Hits, SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.ground_truth.targets import ExtraTargets
from datagen.rendering.exposure import automatic_exposure, develop
from datagen.rendering.rain import with_streaks
from datagen.rendering.sensor import Sensor
from scenes import Scene
from stereoforge_kit.errors import UserError
from stereoforge_kit.processes import captured_output

BLENDER_LOG = "blender.log"
LOG_LINES_SHOWN = 5


@dataclass(frozen=True)
class ViewTargets:
    """The pictures and the ground truth of one view of one frame, as they are stored."""

    images: dict[str, NDArray[np.uint8]]
    """(H, W, 3) sRGB of each render pass, by its name."""
    disparity: NDArray[np.float32]
    """(H, W) px."""
    gradient: NDArray[np.float32]
    """(H, W, 2) forward differences [dx, dy] of the disparity."""
    gradient_valid: NDArray[np.bool_]
    """(H, W) True where the gradient exists and is no discontinuity."""
    occlusion: NDArray[np.uint8]
    """(H, W) 0 visible, 1 occluded, 2 out of the other frame."""
    object_index: NDArray[np.uint16]
    """(H, W) 0 where nothing is hit, else 1 + the index in `Scene.objects`."""
    extra: dict[tuple[str, Direction | None], NDArray[Any]]
    """The targets asked for besides, by kind and direction of time."""


@dataclass(frozen=True)
class RenderOptions:
    """How a Scene is turned into arrays."""

    samples: int = 4
    """Paths per pixel. Ground truth is exact whatever this is."""
    device: str = "cpu"
    """What Cycles computes on: cpu, cuda, optix, hip or metal."""
    threads: int = 1
    """CPU threads that Blender may use."""
    gradient_threshold_px: float = 1.0
    """Larger forward differences are discontinuities and invalid as gradient targets."""
    targets: tuple[str, ...] = ()
    """Which of `EXTRA_TARGETS` to make."""
    passes: tuple[str, ...] = ("clean",)
    """Which of `RENDER_PASSES` to make."""
    engine: str = "cycles"
    """Which of `ENGINES` makes the pictures."""


@dataclass
class Stopwatch:
    """Measures the wall time of steps, in seconds by the step's name."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Add the time spent in the `with` block to the step's."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = round(self.seconds.get(name, 0.0) + time.perf_counter() - start, 4)


class BlenderError(UserError):
    """Blender could not render a scene. The message ends with the end of its log."""


def render_frames(
    scene: Scene,
    scratch: Path,
    options: RenderOptions | None = None,
    watch: Stopwatch | None = None,
    caster: SceneRayCaster | None = None,
) -> Generator[tuple[int, dict[View, ViewTargets]], None, None]:
    """Render a scene; yield (frame, both views' arrays) for every frame, frames counted from 0.

    Blender keeps one world in a process, so use one of these iterators at a time.

    Args:
        scene: The world and its camera.
        scratch: An existing folder for Blender's temporary files and, outside worker processes, its log.
        options: Samples, device, passes and targets.
        watch: Where the time of each step is added up.
        caster: A ray caster of this scene, if there is one already.

    Raises:
        BlenderError: If Blender fails.
        ImportError: On a Python without bpy.
    """
    # Imported here so that planning, verifying and training work on a Python without Blender.
    from datagen.blender.build import build_world
    from datagen.blender.camera import render_view
    from datagen.blender.draft import render_draft, use_workbench
    from datagen.blender.final_pass import render_final
    from datagen.blender.session import CyclesSettings, quiet, start_empty_file

    options, watch = options or RenderOptions(), watch or Stopwatch()
    log = captured_output() or scratch / BLENDER_LOG
    exposure: float | None = None
    try:
        with watch.step("build"), quiet(log):
            caster = caster or SceneRayCaster(build_geometry(scene))
            settings = CyclesSettings(options.samples, options.device, options.threads)
            world = build_world(caster.geometry, start_empty_file(settings))
            if options.engine == "workbench":
                use_workbench(world.blender_scene, options.threads)
        sensor = Sensor(scene)
        extra_targets = ExtraTargets(caster, options.targets)
        for frame in range(scene.frames):
            with watch.step("ground_truth"):
                hits = {view: caster.cast_all(view, frame) for view in VIEWS}
            with watch.step("render"), quiet(log):
                if options.engine == "workbench":
                    radiances = {
                        view: render_draft(world, view, frame, hits[view], caster, scratch) for view in VIEWS
                    }
                else:
                    radiances = {view: render_view(world, view, frame, scratch) for view in VIEWS}
            if exposure is None:  # One exposure for a scene: a camera does not flicker.
                exposure = automatic_exposure(radiances["left"], scene.exposure_key)
            images = {view: {"clean": develop(radiance, exposure)} for view, radiance in radiances.items()}
            if "final" in options.passes:
                with watch.step("render_final"), quiet(log):
                    for view, radiance in render_final(world, frame, exposure, scratch).items():
                        if scene.final.rain is not None:
                            drops, truth = scene.final.rain, hits[view].disparity
                            radiance = with_streaks(
                                radiance, drops, scene.camera, truth, view, frame, sensor.seed
                            )
                        light = sensor.expose(sensor.project(radiance, view), exposure, view, frame)
                        images[view]["final"] = sensor.store(develop(light, 1.0))
            with watch.step("ground_truth"):
                targets = {}
                for view in VIEWS:
                    chosen = {name: images[view][name] for name in options.passes}
                    extra = extra_targets.make(view, frame, hits[view])
                    targets[view] = _targets(chosen, hits[view], options.gradient_threshold_px, extra)
            yield frame, targets
    except RuntimeError as error:
        tail = " | ".join(log.read_text(errors="replace").splitlines()[-LOG_LINES_SHOWN:])
        raise BlenderError(f"{error}; the end of Blender's log: {tail}" if tail else str(error)) from error


def _targets(
    images: dict[str, NDArray[np.uint8]],
    hits: Hits,
    gradient_threshold_px: float,
    extra: dict[tuple[str, Direction | None], NDArray[Any]],
) -> ViewTargets:
    disparity = hits.disparity.astype(np.float32)
    gradient = forward_differences(disparity)
    return ViewTargets(
        images,
        disparity,
        gradient,
        gradient_validity(gradient, gradient_threshold_px),
        hits.occlusion,
        hits.object_index.astype(np.uint16),
        extra,
    )

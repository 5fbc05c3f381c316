"""The job of a worker process: one scene, from the recipe to committed files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from datagen.dataset.layout import FIRST_FRAME, RENDER_PASSES, Direction, Layout, View
from datagen.dataset.manifest import SceneManifest, file_entry, write_manifest
from datagen.errors import DatasetError, MachineError
from datagen.formats import (
    cameras_record,
    write_camera_data,
    write_cameras,
    write_depth,
    write_flow,
    write_gradient,
    write_mask,
    write_normals,
    write_occlusion,
    write_pfm,
    write_png,
)
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.recipe.curation import TEXTURELESS, fault_before_rendering, is_textureless
from datagen.recipe.recipe import Recipe
from datagen.rendering.frames import BLENDER_LOG, RenderOptions, Stopwatch, ViewTargets, render_frames
from datagen.rendering.staging import StagingArea, commit
from scenes import Scene, scene_to_json
from scenes.user_assets.pool import AssetStoreError, UserEnvironment, UserMesh, UserTexture, use_store
from stereoforge_kit.files import LocalTree, Tree, write_text


@dataclass(frozen=True)
class SceneJob:
    """One scene to render, and what it needs."""

    tree: Tree
    """The folder or URL of the data set."""
    area: StagingArea
    """Where the scene is staged before it is committed."""
    recipe: Recipe
    split: str
    scene: int
    device: str = "cpu"
    threads: int = 1
    replaces: str | None = None
    """`manifest_digest` of the scene whose place it takes when it is whole; None for a scene that is missing."""

    @property
    def name(self) -> str:
        """Split and number, for example `train/0003`."""
        return f"{self.split}/{self.scene:04d}"


def render_scene(job: SceneJob) -> SceneManifest:
    """Render, measure and commit one scene; return its manifest.

    Everything is written to a staging folder first and moved into place at the end, the manifest last. So a scene
    with a manifest is whole, whatever happens. Raises DatasetError if every attempt at the scene is degenerate, and
    MachineError if a prepared file of the user's is missing or damaged.
    """
    with job.area.scene_folder(job.split, job.scene) as staging:
        watch = Stopwatch()
        try:
            statistics = _render_staged(job, staging, watch)
        except AssetStoreError as error:
            raise MachineError(str(error)) from error
        return _commit(job, staging, watch, statistics)


def _render_staged(job: SceneJob, staging: Path, watch: Stopwatch) -> dict[str, Any]:
    """Stage all files but the manifest of the first attempt that is not degenerate; return its statistics."""
    if isinstance(job.tree, LocalTree):
        use_store(Layout(job.tree.root).assets)
    rejected: Counter[str] = Counter()
    for attempt in range(job.recipe.curation.attempts):
        with watch.step("sample"):
            scene = job.recipe.sample(job.split, job.scene, attempt)
            caster = SceneRayCaster(build_geometry(scene))
        with watch.step("ground_truth"):  # The tree of triangles built here serves the first frame too.
            fault = fault_before_rendering(caster, job.recipe.curation)
        frames = None if fault else _render_attempt(job, staging, caster, watch)
        if frames is not None:
            statistics = _scene_statistics(scene, frames, rejected)
            return statistics | {"assets": _assets_used(job.recipe, scene)}
        rejected[fault or TEXTURELESS] += 1
    reasons = ", ".join(f"{reason} ({count})" for reason, count in rejected.most_common())
    raise DatasetError(
        f"scene {job.name}: {job.recipe.curation.attempts} attempts were degenerate: {reasons}"
    )


def _render_attempt(
    job: SceneJob, staging: Path, caster: SceneRayCaster, watch: Stopwatch
) -> list[dict[str, float]] | None:
    """Render and stage a scene; return its frames' statistics, or None if the first picture is textureless."""
    recipe, staged, scene = job.recipe, Layout(staging), caster.geometry.scene
    options = RenderOptions(
        recipe.samples,
        job.device,
        job.threads,
        recipe.gradient_threshold_px,
        recipe.targets,
        recipe.passes,
        recipe.engine,
    )
    statistics: list[dict[str, float]] = []
    with closing(render_frames(scene, staging, options, watch, caster)) as frames:
        for frame, targets in frames:
            if frame == 0 and is_textureless(next(iter(targets["left"].images.values())), recipe.curation):
                return None
            with watch.step("write"):
                for view, arrays in targets.items():
                    _write_view(staged, job, view, FIRST_FRAME + frame, arrays)
                statistics.append(_frame_statistics(targets["left"]))
    with watch.step("write"):
        _write_scene_files(staged, job, scene)
    (staging / BLENDER_LOG).unlink(missing_ok=True)
    return statistics


_EXTRA_WRITERS: dict[str, Callable[[Path, Any], None]] = {
    "depth": write_depth,
    "material_index": write_png,
    "reflective": write_png,
    "normals": write_normals,
    "optical_flow": write_flow,
    "disparity_change": write_pfm,
    "motion_boundaries": write_mask,
}


def _write_view(layout: Layout, job: SceneJob, view: View, number: int, arrays: ViewTargets) -> None:
    def path(kind: str, direction: Direction | None = None) -> Path:
        return layout.file(kind, job.split, job.scene, view, number, direction)

    for name, image in arrays.images.items():
        write_png(path(RENDER_PASSES[name]), image)
    write_pfm(path("disparity"), arrays.disparity)
    write_gradient(path("disparity_gradient"), arrays.gradient, arrays.gradient_valid)
    write_occlusion(path("occlusion"), arrays.occlusion)
    write_png(path("object_index"), arrays.object_index)
    for (kind, direction), values in arrays.extra.items():
        _EXTRA_WRITERS[kind](path(kind, direction), values)


def _write_scene_files(layout: Layout, job: SceneJob, scene: Scene) -> None:
    poses = {
        FIRST_FRAME + frame: (scene.camera.pose("left", frame), scene.camera.pose("right", frame))
        for frame in range(scene.frames)
    }
    write_camera_data(layout.file("camera_data", job.split, job.scene), poses)
    times = {FIRST_FRAME + frame: float(frame) for frame in range(scene.frames)}
    write_cameras(layout.file("cameras", job.split, job.scene), cameras_record(scene.camera, times))
    write_text(layout.scene_record(job.split, job.scene), scene_to_json(scene))


def _frame_statistics(left: ViewTargets) -> dict[str, float]:
    low, middle, high = np.percentile(left.disparity, (1, 50, 99))
    return {
        "disparity_p01_px": float(low),
        "disparity_median_px": float(middle),
        "disparity_p99_px": float(high),
        "occluded_share": float((left.occlusion == OCCLUDED).mean()),
        "out_of_frame_share": float((left.occlusion == OUT_OF_FRAME).mean()),
        "gradient_valid_share": float(left.gradient_valid.mean()),
        "mean_level": float(next(iter(left.images.values())).mean()),
        "visible_objects": float(np.count_nonzero(np.unique(left.object_index))),
    }


def _scene_statistics(scene: Scene, frames: list[dict[str, float]], rejected: Counter[str]) -> dict[str, Any]:
    """Counts, means over the frames of what was measured in the left view, and the reasons of rejections."""
    means = {key: round(float(np.mean([frame[key] for frame in frames])), 5) for key in frames[0]}
    return {"objects": len(scene.objects), "frames": scene.frames, **means, "rejected": dict(rejected)}


def _assets_used(recipe: Recipe, scene: Scene) -> list[str]:
    """The names of the user assets in a scene."""
    candidates = (
        *(thing.shape for thing in scene.objects),
        *(material.color for material in scene.materials),
        scene.world.environment,
    )
    used = {item.sha256 for item in candidates if isinstance(item, UserMesh | UserTexture | UserEnvironment)}
    return sorted(asset.name for asset in recipe.assets.files if asset.sha256 in used)


def _commit(job: SceneJob, staging: Path, watch: Stopwatch, statistics: dict[str, Any]) -> SceneManifest:
    """Move the staged scene into the data set, its manifest last."""
    files = sorted(path for path in staging.rglob("*") if path.is_file())
    manifest = _manifest(job, staging, files, watch, statistics)
    write_manifest(Layout(staging).manifest(job.split, job.scene), manifest)
    with job.area.committing(job.split, job.scene):
        commit(job.tree, staging, job.split, job.scene, job.replaces)
    return manifest


def _manifest(
    job: SceneJob, staging: Path, files: list[Path], watch: Stopwatch, statistics: dict[str, Any]
) -> SceneManifest:
    from datagen.blender.session import blender_version

    return SceneManifest(
        family=job.recipe.family,
        split=job.split,
        scene=job.scene,
        recipe_sha256=job.recipe.settings_sha256(),
        files=tuple(file_entry(staging, path) for path in files),
        seconds=watch.seconds,
        statistics=statistics,
        versions={
            "stereoforge": version("stereoforge"),
            "blender": blender_version(),
            "numpy": np.__version__,
        },
    )

"""Random worlds: disparity against the independent ray cast, pictures against disparity, labels against both."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from datagen.dataset.layout import VIEWS, View
from datagen.formats.occlusion import OCCLUDED, OUT_OF_FRAME, VISIBLE
from datagen.ground_truth.labels import SAME_SURFACE
from datagen.ground_truth.raycast import Hits, SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.rendering.frames import RenderOptions, ViewTargets, render_frames
from scenes import FAMILIES, Scene, sample_scene
from scenes.spec import Rig
from tests.datagen.oracle import cast_depth, segment_is_blocked, to_camera_frame

MANY = ((240, 136, 5), (160, 90, 5))
"""Width, height and number of the scenes of each family whose truth is compared with other rays."""
FEW = ((240, 136, 2), (160, 90, 2))
"""Those that are also rendered."""
MORE_SCENES = int(os.environ.get("EXACTNESS_SCENES", "0"))
"""So many of each size instead, for figures worth quoting."""


@dataclass(frozen=True)
class World:
    """The truth of one scene's first frame, and the triangles that Blender evaluated for it."""

    scene: Scene
    truth: dict[View, Hits]
    triangles: NDArray[np.float64]

    def seen_from(self, x_m: float) -> NDArray[np.float64]:
        """(T, 3, 3) the triangles in the frame of a view at x metres along the rig's axis; the left one is at 0."""
        return to_camera_frame(self.triangles, self.scene.camera.pose("left", 0.0)) - (x_m, 0.0, 0.0)

    @property
    def rig(self) -> Rig:
        return rig_of(self.scene)

    def camera_x(self, view: View) -> float:
        return 0.0 if view == "left" else self.rig.baseline_m

    def cast_depth(self, x_m: float, view: View, shift_px: float = 0.0) -> NDArray[np.float64]:
        rig, center = self.rig, center_of(self.rig, view)
        return cast_depth(
            self.seen_from(x_m), rig.width, rig.height, rig.fx, rig.fy, center - shift_px, rig.cy
        )


@dataclass(frozen=True)
class Picture:
    """One rendered scene."""

    scene: Scene
    targets: dict[View, ViewTargets]
    cycles: NDArray[np.float64]
    """(H, W) disparity of the left view by Cycles' depth pass."""


def own_rig(width: int, height: int) -> Rig:
    """A rig as `--camera` reads one: oblong pixels, axes beside the middle, each view's at another place."""
    return Rig(width, height, 0.9 * width, 0.97 * width, 0.54 * width, 0.58 * width, 0.41 * height, 0.4)


def rig_of(scene: Scene) -> Rig:
    """What the scene was asked to be seen by, or the centred rig with square pixels of the family's own lens."""
    camera = scene.camera
    if scene.notes.get("own_rig"):
        return own_rig(camera.width, camera.height)
    focal_px = camera.focal_mm / 32 * camera.width
    middle = camera.width / 2
    return Rig(
        camera.width, camera.height, focal_px, focal_px, middle, middle, camera.height / 2, camera.baseline_m
    )


def center_of(rig: Rig, view: View) -> float:
    return rig.cx_left if view == "left" else rig.cx_right


def disparity_at(rig: Rig, depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """x_left - x_right of a point: fx (X / Z) + cx_left - fx ((X - B) / Z) - cx_right."""
    return rig.fx * rig.baseline_m / depth + rig.cx_left - rig.cx_right


def scenes_of(world: str, sizes: tuple[tuple[int, int, int], ...]) -> Iterator[Scene]:
    family, _, kind = world.partition(" ")
    rig = kind == "own rig"
    for width, height, count in sizes:
        for seed in range(MORE_SCENES or count):
            config = FAMILIES[family].config(width=width, height=height)
            config = (
                replace(config, rig=own_rig(width, height))
                if rig
                else replace(config, **AT_NIGHT.get(kind, {}))
            )
            scene = sample_scene(np.random.default_rng([seed, width]), family, config)
            yield replace(scene, notes={**scene.notes, "own_rig": float(rig)})


OPTIONS = RenderOptions(samples=4, targets=("reflective",))

AT_NIGHT: dict[str, dict[str, Any]] = {
    "night rain": {"night_share": 1.0, "dusk_share": 0.0, "rain_share": 1.0, "transparent_share": 1.0}
}
"""Worlds of a family in which pictures are hardest to make: lamps, mirrors of water, clear glass, drops."""
WORLDS = [*sorted(FAMILIES), *(f"{family} own rig" for family in sorted(FAMILIES)), "driving night rain"]
"""Every family, by its own cameras and by somebody's rig."""


@pytest.fixture(scope="module", params=WORLDS)
def worlds(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[World]:
    """Random scenes of a family, built in Blender but not rendered."""
    from datagen.blender.build import build_world, place
    from datagen.blender.session import CyclesSettings, quiet, start_empty_file
    from tests.datagen.blender_geometry import evaluated_triangles

    made = []
    for scene in scenes_of(request.param, MANY):
        caster = SceneRayCaster(build_geometry(scene))
        with quiet(tmp_path_factory.mktemp("blender") / "log"):
            place(build_world(caster.geometry, start_empty_file(CyclesSettings(samples=1))), "left", 0.0)
        made.append(World(scene, {view: caster.cast_all(view, 0.0) for view in VIEWS}, evaluated_triangles()))
    return made


@pytest.fixture(
    scope="module",
    params=[*sorted(FAMILIES), "flying_things own rig", "driving own rig", "driving night rain"],
)
def pictures(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[Picture]:
    """A few random scenes of a family, rendered."""
    made = []
    for scene in scenes_of(request.param, FEW):
        scratch = tmp_path_factory.mktemp("blender")
        ((_, targets),) = render_frames(replace(scene, frames=1), scratch, OPTIONS)
        made.append(Picture(scene, targets, cycles_disparity(scene, scratch)))
    return made


def cycles_disparity(scene: Scene, scratch: Path) -> NDArray[np.float64]:
    """(H, W) the left view's disparity by Cycles' own depth pass, its pixel filter as narrow as it gets."""
    from datagen.blender.build import build_world, place
    from datagen.blender.camera import render_channels
    from datagen.blender.session import CyclesSettings, quiet, start_empty_file

    with quiet(scratch / "log"):
        blender_scene = start_empty_file(CyclesSettings(samples=1))
        blender_scene.view_layers[0].use_pass_z = True
        blender_scene.cycles.use_denoising = False
        blender_scene.cycles.pixel_filter_type, blender_scene.cycles.filter_width = "BOX", 0.01
        world = build_world(build_geometry(scene), blender_scene)
        place(world, "left", 0.0)
        channels = render_channels(world, "depth", 0, scratch)
    depth = channels["Depth.Z" if "Depth.Z" in channels else "Depth.V"].astype(np.float64)
    return disparity_at(rig_of(scene), np.where(depth < 1e9, depth, np.inf))  # 1e10 is the sky


def errors(
    worlds: list[World], view: View, *, seen_as: View | None = None, sign: float = 1.0, shift_px: float = 0.0
) -> NDArray[np.float64]:
    """|truth - cast| of every pixel of every world, px; the rays cast from a wrong place on request."""
    found = []
    for world in worlds:
        seen = seen_as or view
        depth = world.cast_depth(sign * world.camera_x(seen), seen, shift_px)
        stored = world.truth[view].disparity.astype(np.float32)
        found.append(np.abs(stored - disparity_at(world.rig, depth)).ravel())
    return np.concatenate(found)


def named(worlds: list[World]) -> str:
    scene = worlds[0].scene
    dark = scene.final.rain is not None and all(world.scene.final.rain for world in worlds)
    return scene.family + (" own rig" if scene.notes["own_rig"] else " night rain" if dark else "")


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
def test_disparity_equals_the_float64_ray_cast(worlds: list[World], view: View) -> None:
    error = errors(worlds, view)
    median, p999 = np.percentile(error, (50, 99.9))
    off = float((error > 0.1).mean())
    print(
        f"{named(worlds)} {view}: {len(worlds)} scenes, {error.size} px, median {median:.1e} px, "
        f"p99.9 {p999:.1e} px, off by > 0.1 px {off:.1e}"
    )
    assert median <= 1e-4
    assert p999 <= 1e-3
    assert off <= 1e-4


MISTAKES: dict[str, tuple[View, dict[str, Any]]] = {
    "left half a pixel left": ("left", {"shift_px": -0.5}),
    "left half a pixel right": ("left", {"shift_px": 0.5}),
    "right half a pixel left": ("right", {"shift_px": -0.5}),
    "right half a pixel right": ("right", {"shift_px": 0.5}),
    "right camera on the left": ("right", {"sign": -1.0}),
    "right for left": ("left", {"seen_as": "right"}),
    "left for right": ("right", {"seen_as": "left"}),
}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_classical_mistakes_would_break_the_bars(worlds: list[World], mistake: str) -> None:
    view, wrongly = MISTAKES[mistake]
    error = errors(worlds[:2], view, **wrongly)
    assert np.percentile(error, 99.9) > 1.0
    assert (error > 0.1).mean() > 1e-3


def wrong_labels(worlds: list[World], view: View, sign: float = 1.0) -> tuple[int, int]:
    """Of some pixels of every world, each against every triangle between it and the other view: how many differ.

    sign: -1 to look for the other view on the wrong side.
    """
    rng = np.random.default_rng(1)
    wrong = total = 0
    for world in worlds:
        rig, labels = world.rig, world.truth[view].occlusion
        triangles = world.seen_from(world.camera_x(view))
        rows, columns = np.unravel_index(
            rng.choice(np.flatnonzero(labels != OUT_OF_FRAME), 60, replace=False), labels.shape
        )
        depth = world.cast_depth(world.camera_x(view), view)[rows, columns]
        other = np.array([sign * (1.0 if view == "left" else -1.0) * rig.baseline_m, 0.0, 0.0])
        x, y = columns + 0.5 - center_of(rig, view), rig.cy - rows - 0.5
        rays = np.stack([x / rig.fx, y / rig.fy, -np.ones(len(rows))], -1)
        for ray, z, label in zip(rays, depth, labels[rows, columns], strict=True):
            way, reach = (ray, np.inf) if np.isinf(z) else (z * ray - other, 1 - SAME_SURFACE)
            wrong += segment_is_blocked(triangles, other, way, reach) != (label == OCCLUDED)
            total += 1
    return wrong, total


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
def test_occlusion_equals_rays_in_double_precision(worlds: list[World], view: View) -> None:
    wrong, total = wrong_labels(worlds, view)
    print(f"{named(worlds)} {view}: {wrong} of {total} labels differ")
    assert wrong <= 0.002 * total


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
def test_occlusion_from_the_wrong_side_would_be_seen(worlds: list[World], view: View) -> None:
    wrong, total = wrong_labels(worlds, view, sign=-1.0)
    assert wrong > 0.02 * total


def behind_glass(picture: Picture) -> NDArray[np.bool_]:
    """(H, W) True where the left view sees a pane that light passes straight through."""
    scene = picture.scene
    thin = np.array([False, *(scene.materials[thing.material].thin for thing in scene.objects)])
    return np.asarray(thin[picture.targets["left"].object_index])


@pytest.mark.slow
def test_cycles_shows_the_surfaces_that_the_truth_is_of(pictures: list[Picture]) -> None:
    """The pictures' own depth: near the centres and in 32 bits, so looser than the bars above.

    Cycles writes the depth of what is behind a pane that light passes straight through; ground truth is of the pane.
    """
    error = np.concatenate(
        [np.abs(p.targets["left"].disparity - p.cycles)[~behind_glass(p)] for p in pictures]
    )
    median, p999 = np.percentile(error, (50, 99.9))
    off = float((error > 0.1).mean())
    print(f"Cycles: {error.size} px, median {median:.1e} px, p99.9 {p999:.1e} px, off by > 0.1 px {off:.1e}")
    assert median <= 1e-4
    assert off <= 1e-3


@pytest.mark.slow
def test_what_is_rendered_is_what_is_compared_here(pictures: list[Picture]) -> None:
    caster = SceneRayCaster(build_geometry(pictures[0].scene))
    for view in VIEWS:
        hits, targets = caster.cast_all(view, 0.0), pictures[0].targets[view]
        assert np.array_equal(targets.disparity, hits.disparity.astype(np.float32))
        assert np.array_equal(targets.object_index, hits.object_index)
        assert np.array_equal(targets.occlusion, hits.occlusion)


def warp_error(picture: Picture, shift_px: float = 0.0, sign: float = -1.0) -> NDArray[np.float64]:
    """(H, W) squared error, in levels, of the left picture against the right one sampled at x - d."""
    left, right = picture.targets["left"], picture.targets["right"]
    rows, columns = np.mgrid[: left.disparity.shape[0], : left.disparity.shape[1]].astype(float)
    where = [rows, columns + sign * left.disparity + shift_px]
    warped = np.stack(
        [
            map_coordinates(right.images["clean"][..., c].astype(float), where, order=1, mode="nearest")
            for c in range(3)
        ],
        -1,
    )
    return ((warped - left.images["clean"]) ** 2).mean(axis=-1)


def psnr(squared_errors: list[NDArray[np.float64]]) -> float:
    return float(10 * np.log10(255**2 / np.concatenate(squared_errors).mean()))


def matte_labels(picture: Picture) -> NDArray[np.integer[Any]]:
    """(H, W) the occlusion of the left view's matte pixels, -1 elsewhere: what a surface mirrors moves as it likes."""
    targets = picture.targets["left"]
    return np.where(targets.extra["reflective", None] > 0, -1, targets.occlusion.astype(int))


@pytest.mark.slow
def test_warping_right_to_left_reproduces_it_where_visible(pictures: list[Picture]) -> None:
    labels = [matte_labels(w) for w in pictures]
    exact = [warp_error(w) for w in pictures]
    visible = psnr([e[m == VISIBLE] for e, m in zip(exact, labels, strict=True)])
    occluded = psnr([e[m == OCCLUDED] for e, m in zip(exact, labels, strict=True)])
    half = psnr([warp_error(w, 0.5)[m == VISIBLE] for w, m in zip(pictures, labels, strict=True)])
    wrong_sign = psnr([warp_error(w, sign=1.0)[m == VISIBLE] for w, m in zip(pictures, labels, strict=True)])
    print(
        f"warp PSNR: visible {visible:.2f} dB, occluded {occluded:.2f} dB, "
        f"half a pixel off {half:.2f} dB, wrong sign {wrong_sign:.2f} dB"
    )
    assert visible > 24.0
    assert occluded < visible - 6.0
    # There is little contrast to move by half a pixel in the dark.
    assert half < visible - (0.4 if all(w.scene.final.rain for w in pictures) else 1.0)
    assert wrong_sign < visible - 6.0


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
def test_occlusion_agrees_with_the_other_views_disparity(pictures: list[Picture], view: View) -> None:
    """A visible point is seen at the same disparity by the other view, an occluded one behind something nearer."""
    sign, other_view = (-1.0, "right") if view == "left" else (1.0, "left")
    visible_agrees, occluded_agrees = [], []
    for picture in pictures:
        own, other = picture.targets[view], picture.targets[other_view]
        height, width = own.disparity.shape
        rows, columns = np.mgrid[:height, :width]
        x = columns + sign * own.disparity
        near = [np.clip(np.floor(x).astype(int) + k, 0, width - 1) for k in (0, 1)]
        seen = np.stack([other.disparity[rows, column] for column in near])
        # The two neighbours bracket the point unless a silhouette runs between them.
        tolerance = np.abs(seen[0] - seen[1]) + 0.05
        same = np.abs(seen - own.disparity).min(axis=0) <= tolerance
        nearer = seen.max(axis=0) > own.disparity + 1e-3
        visible_agrees.append(same[own.occlusion == VISIBLE])
        occluded_agrees.append(nearer[own.occlusion == OCCLUDED])
    # What is seen or hides a point may be thinner than a pixel and lie between the centres that are compared here:
    # leaves and fences, which only some families are full of.
    thin = pictures[0].scene.family != "flying_things"
    visible, occluded = (float(np.concatenate(each).mean()) for each in (visible_agrees, occluded_agrees))
    print(f"{view}: {visible:.2%} of visible, {occluded:.2%} of occluded points agree")
    assert visible > (0.97 if thin else 0.99)
    assert occluded > (0.92 if thin else 0.99)


def test_scratch_folder_is_left_clean(tmp_path: Path) -> None:
    config = FAMILIES["flying_things"].config(width=64, height=36)
    scene = sample_scene(np.random.default_rng(0), "flying_things", config)
    list(render_frames(scene, tmp_path, RenderOptions(samples=1)))
    assert [path.name for path in tmp_path.iterdir()] == ["blender.log"]

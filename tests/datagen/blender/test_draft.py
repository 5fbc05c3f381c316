"""Drafts by Workbench: the same scene as the truth's, from the sky to what is near; Blender draws."""

from __future__ import annotations

from ctypes.util import find_library
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from datagen import DatasetError, Recipe, render_dataset
from datagen.blender.build import build_world
from datagen.blender.camera import render_view
from datagen.blender.draft import sky_radiance
from datagen.blender.session import CyclesSettings, quiet, start_empty_file
from datagen.dataset.samples import StereoDataset
from datagen.formats.occlusion import VISIBLE
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.recipe.recipe import recipe_from_plain, recipe_to_plain
from datagen.rendering.frames import RenderOptions, render_frames
from datagen.rendering.preflight import check_engine
from scenes import FAMILIES, Scene, sample_scene
from scenes.shapes.solids.basic import Plane
from scenes.spec import Material, SceneObject, StereoCamera, Trajectory, World
from scenes.textures.plain import SolidColor

needs_opengl = pytest.mark.skipif(find_library("EGL") is None, reason="needs OpenGL's libegl1")

DRAFT = RenderOptions(engine="workbench")


def world(family: str, seed: int = 3) -> Scene:
    config = replace(FAMILIES[family].config(), width=240, height=136)
    return sample_scene(np.random.default_rng(seed), family, config)


@needs_opengl
@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_the_views_match_at_the_true_disparity_and_nowhere_else(family: str, tmp_path: Path) -> None:
    """What both views show of a surface looks alike, since the lights come with the camera."""
    ((_, targets),) = render_frames(replace(world(family), frames=1), tmp_path, DRAFT)
    left, right = (targets[view].images["clean"].astype(float) for view in ("left", "right"))
    seen = (targets["left"].occlusion == VISIBLE) & (targets["left"].object_index > 0)

    def difference(shift: float) -> float:
        rows, columns = np.nonzero(seen)
        at = np.stack([rows, columns - targets["left"].disparity[seen] - shift])
        looked_up = np.stack([map_coordinates(right[..., c], at, order=1, mode="nearest") for c in range(3)])
        return float(np.median(np.abs(looked_up.T - left[seen])))

    assert difference(0.0) < 3.0
    assert difference(0.0) < 0.7 * min(difference(-2.0), difference(2.0))


def test_the_sky_is_where_cycles_shows_it(tmp_path: Path) -> None:
    """Cycles renders the environment alone, without anything before it."""
    scene = world("driving")
    alone = replace(scene, objects=(), lights=())
    caster = SceneRayCaster(build_geometry(alone))
    with quiet(tmp_path / "log"):
        settings = CyclesSettings(samples=16)
        cycles = render_view(build_world(caster.geometry, start_empty_file(settings)), "right", 0, tmp_path)
    rows, columns = (index.ravel() for index in np.indices(cycles.shape[:2]))
    turned = caster.directions("right", rows, columns) @ scene.camera.pose("right", 0.0)[:3, :3].T
    sky = sky_radiance(scene.world, turned).reshape(cycles.shape) * scene.world.strength
    assert np.abs(sky - cycles).mean() < 0.02 * cycles.mean()
    assert np.abs(sky[:, ::-1] - cycles).mean() > 0.05 * cycles.mean()


@needs_opengl
def test_what_is_near_and_what_is_far_are_both_drawn(tmp_path: Path) -> None:
    """A plane two centimetres away beside one at five kilometres: a depth buffer has to hold both."""
    near, far = Material(SolidColor((250, 10, 10))), Material(SolidColor((10, 10, 250)))
    things = (
        SceneObject("near", Plane(), 0, Trajectory.static((-0.02, 0.0, -0.02)), (0.02, 0.02, 1.0)),
        SceneObject("far", Plane(), 1, Trajectory.static((0.0, 0.0, -5e3)), (2e4, 2e4, 1.0)),
    )
    camera = StereoCamera(96, 64, 16.0, 0.001, Trajectory.static())
    scene = Scene("draft", 1, camera, things, (near, far), (), World(SolidColor((0, 0, 0))))
    ((_, targets),) = render_frames(scene, tmp_path, DRAFT)
    for view in targets.values():
        redder = view.images["clean"][..., 0] > view.images["clean"][..., 2]
        agree = redder == (view.object_index == 1)
        assert 0.1 < redder.mean() < 0.9
        assert agree.mean() > 0.98  # all but the pixels that the edge goes through


@needs_opengl
def test_a_set_of_drafts_says_so_and_is_the_same_again(tmp_path: Path) -> None:
    recipe = Recipe(
        replace(FAMILIES["indoor"].config(), width=96, height=64), {"train": 1}, engine="workbench"
    )
    pictures: list[NDArray[np.uint8]] = []
    for name in ("one", "two"):
        render_dataset(recipe, tmp_path / name, workers=1)
        pictures.append(StereoDataset(tmp_path / name, "train")[0].left)
    assert (pictures[0] == pictures[1]).all()
    assert "- Pictures: drafts by Blender's Workbench." in (tmp_path / "one" / "README.md").read_text()
    with pytest.raises(DatasetError, match="engine workbench, not the default"):
        render_dataset(replace(recipe, engine="cycles"), tmp_path / "one")


def test_recipes_of_cycles_are_as_they_were() -> None:
    """Sets that are there keep their settings' digests."""
    recipe = Recipe(FAMILIES["indoor"].config(), {"train": 1})
    assert "engine" not in recipe_to_plain(recipe)
    drafts = replace(recipe, engine="workbench")
    assert recipe_from_plain(recipe_to_plain(drafts), "here") == drafts
    assert drafts.settings_sha256() != recipe.settings_sha256()


def test_what_no_draft_can_be_is_refused() -> None:
    recipe = Recipe(FAMILIES["indoor"].config(), {"train": 1})
    with pytest.raises(DatasetError, match="final pass needs the engine cycles"):
        replace(recipe, engine="workbench", passes=("clean", "final"))
    with pytest.raises(DatasetError, match="engine must be among cycles, workbench, got 'eevee'"):
        replace(recipe, engine="eevee")


@needs_opengl
def test_a_machine_without_opengl_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    check_engine("workbench")
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere")
    with pytest.raises(DatasetError, match="apt-get install libegl1"):
        check_engine("workbench")

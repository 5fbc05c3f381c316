"""A range of disparities asked for is what is seen, judged by rays over another grid than the one that chose it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from datagen import DatasetError, Recipe
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.recipe.curation import Curation
from scenes import FAMILIES, Scene


def recipe(family: str, low: float, high: float) -> Recipe:
    return Recipe(
        FAMILIES[family].config(width=480, height=270),
        {"train": 1},
        curation=Curation(disparity_px=(low, high)),
    )


def surfaces(scene: Scene) -> NDArray[np.float64]:
    rows, columns = (grid.ravel() for grid in np.mgrid[3:270:9, 3:480:9])
    hits = SceneRayCaster(build_geometry(scene)).cast("left", 0, rows, columns)
    return hits.disparity[hits.object_index > 0]


@pytest.mark.parametrize("family", ["driving", "monkaa", "sintel"])
def test_the_baseline_brings_near_surfaces_to_the_greatest_disparity(family: str) -> None:
    wanted = recipe(family, 0.0, 70.0)
    scene = wanted.sample("train", 0)
    assert np.percentile(surfaces(scene), 99.5) == pytest.approx(70.0, rel=0.12)
    assert scene == wanted.sample("train", 0)
    usual = replace(wanted, curation=Curation()).sample("train", 0)
    assert replace(usual, camera=replace(usual.camera, baseline_m=scene.camera.baseline_m)) == scene


@pytest.mark.parametrize("limits", [(3.0, 30.0), (10.0, 120.0)])
def test_flying_things_stand_within_the_range(limits: tuple[float, float]) -> None:
    seen = np.concatenate([surfaces(recipe("flying_things", *limits).sample("train", k)) for k in range(2)])
    assert ((seen < limits[0]) | (seen > limits[1])).mean() < 0.02
    assert np.percentile(seen, 99) > 0.7 * limits[1]
    assert np.percentile(seen, 1) < 4 * limits[0]


def test_ranges_that_a_family_cannot_have_are_refused() -> None:
    with pytest.raises(DatasetError, match="horizon"):
        recipe("driving", 5.0, 100.0)
    with pytest.raises(DatasetError, match="above 0"):
        recipe("flying_things", 0.0, 100.0)

"""A histogram asked for is what a set shows, judged by rays over another grid than the one that chose it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import datagen.recipe.disparity_histogram
import datagen.recipe.recipe
from datagen import DatasetError, Recipe
from datagen.dataset.statistics import SetStatistics
from datagen.gallery.page import histograms
from datagen.ground_truth.raycast import SceneRayCaster
from datagen.ground_truth.scene_geometry import build_geometry
from datagen.recipe.curation import Curation
from datagen.recipe.disparity_histogram import Component, DisparityHistogram
from datagen.recipe.recipe import fit_disparities, recipe_from_text, recipe_to_text
from scenes import FAMILIES

WANTED = DisparityHistogram((2.0, 10.0, 20.0, 40.0, 60.0), (0.1, 0.5, 0.3, 0.1))
SCENES = 20


@pytest.fixture(scope="module")
def recipe() -> Recipe:
    world = FAMILIES["flying_things"].config(
        width=320, height=180, flying_objects=(4, 6), background_objects=(6, 9)
    )
    return fit_disparities(Recipe(world, {"train": SCENES}, disparities=WANTED))


def surfaces(recipe: Recipe) -> NDArray[np.float64]:
    rows, columns = (grid.ravel() for grid in np.mgrid[3:180:7, 3:320:7])
    shown = [
        SceneRayCaster(build_geometry(recipe.sample("train", number))).cast("left", 0, rows, columns)
        for number in range(recipe.scenes["train"])
    ]
    return np.concatenate([hits.disparity[hits.object_index > 0] for hits in shown])


def test_a_set_has_the_histogram_asked_for(recipe: Recipe) -> None:
    seen = surfaces(recipe)
    found = np.histogram(seen, WANTED.edges_px)[0] / len(seen)
    print(recipe.disparities, "found", found, "missed", WANTED.missed(seen))
    assert WANTED.missed(seen) < 0.12
    np.testing.assert_allclose(found, WANTED.shares, atol=0.1)
    usual = replace(recipe, disparities=None, scenes={"train": 6})
    assert WANTED.missed(surfaces(usual)) > 0.2


def test_the_recipe_keeps_what_was_found_and_others_are_written_as_before(recipe: Recipe) -> None:
    again = recipe_from_text(recipe_to_text(recipe).encode(), "it")
    assert again == recipe
    assert again.sample("train", 3) == recipe.sample("train", 3)
    assert "disparities" not in recipe_to_text(replace(recipe, disparities=None))


def test_constructing_and_reading_a_recipe_samples_no_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("a scene was sampled")

    for module in (datagen.recipe.recipe, datagen.recipe.disparity_histogram):
        monkeypatch.setattr(module, "sample_scene", refuse)
    unfitted = Recipe(FAMILIES["flying_things"].config(), {"train": SCENES}, disparities=WANTED)
    assert recipe_from_text(recipe_to_text(unfitted).encode(), "it") == unfitted
    with pytest.raises(ValueError, match="no components yet"):
        unfitted.sample("train", 0)
    with pytest.raises(AssertionError, match="a scene was sampled"):
        fit_disparities(unfitted)


def test_fitting_again_changes_nothing(recipe: Recipe) -> None:
    assert fit_disparities(recipe) is recipe
    plain = replace(recipe, disparities=None)
    assert fit_disparities(plain) is plain


def test_any_run_of_scenes_takes_turns_among_the_components() -> None:
    shares = (0.1, 0.6, 0.3)
    wanted = replace(WANTED, components=tuple(Component(share, 1.0 + share) for share in shares))
    for first in (0, 1000):
        drawn = [wanted.component(number).share for number in range(first, first + 50)]
        for share in shares:
            assert drawn.count(share) == pytest.approx(50 * share, abs=2)


def test_what_misses_a_histogram_is_what_would_have_to_move() -> None:
    exact = np.array([5.0] * 1 + [15.0] * 5 + [30.0] * 3 + [50.0])
    assert WANTED.missed(exact) == pytest.approx(0.0)
    assert WANTED.missed(np.append(np.zeros(90), exact)) == pytest.approx(0.0)  # The sky does not count.
    assert WANTED.missed(np.where(exact == 50.0, 200.0, exact)) == pytest.approx(0.1)
    assert WANTED.missed(np.full(7, 5.0)) == pytest.approx(0.9)


def test_the_gallery_draws_it_beside_what_was_found() -> None:
    disparity = np.repeat([0, 5, 15, 30, 50], [10, 1, 5, 3, 1]).astype(np.float32)
    shares = np.array([0.1, 0.2])
    statistics = {"train": SetStatistics(disparity, shares, shares, np.array([3, 4]), shares)}
    axes = histograms(statistics, WANTED)[0].axes[0]
    assert "asked for" in {text.get_text() for text in axes.figure.findobj(lambda a: hasattr(a, "get_text"))}


@pytest.mark.parametrize(
    ("edges", "shares", "message"),
    [
        ((2.0, 10.0), (0.5, 0.5), "one more edge"),
        ((10.0, 2.0), (1.0,), "must increase"),
        ((2.0, 10.0), (0.7,), "add up to 1"),
    ],
)
def test_what_is_no_histogram_is_refused(
    edges: tuple[float, ...], shares: tuple[float, ...], message: str
) -> None:
    with pytest.raises(DatasetError, match=message):
        DisparityHistogram(edges, shares)


def test_a_range_and_a_histogram_at_once_are_refused(recipe: Recipe) -> None:
    with pytest.raises(DatasetError, match="not both"):
        replace(recipe, curation=Curation(disparity_px=(2.0, 60.0)))

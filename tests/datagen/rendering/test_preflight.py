"""What cannot be had is refused in one sentence before anything is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from datagen import DatasetError, Recipe, render_dataset
from datagen.recipe.curation import Curation
from datagen.rendering.preflight import check_device, check_disparity_range
from scenes import FAMILIES

NO_DEVICE = "metal"
"""Of Apple's machines alone, which the workers do not run on."""


def recipe(low: float, high: float, **curation: object) -> Recipe:
    world = FAMILIES["flying_things"].config(width=240, height=135)
    return Recipe(world, {"train": 3}, curation=Curation(disparity_px=(low, high), attempts=3, **curation))


def test_a_device_that_is_not_there_is_one_sentence_and_no_quarantine(tmp_path: Path) -> None:
    check_device("cpu")
    plain = replace(recipe(1, 40), curation=Curation())
    with pytest.raises(DatasetError, match=r"^Blender finds no metal device on this machine; "):
        render_dataset(plain, tmp_path / "set", device=NO_DEVICE)
    assert not (tmp_path / "set").exists()
    render_dataset(
        replace(plain, scenes={}), tmp_path / "set", device=NO_DEVICE
    )  # Nothing is to be rendered.


def test_a_range_too_narrow_for_the_family_is_refused_with_what_there_is(tmp_path: Path) -> None:
    sentence = r"within disparities of 9 to 10 px at 240x135: the best of 3 has \d+% .* outside and spans"
    with pytest.raises(DatasetError, match=sentence):
        render_dataset(recipe(9, 10), tmp_path / "set")
    assert not (tmp_path / "set").exists()
    check_disparity_range(recipe(0.6, 40))
    check_disparity_range(recipe(9, 10, enabled=False))
    check_disparity_range(recipe(9, 10, max_outside=1.0))

"""Recipes: what may be added to a folder that has one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from datagen import DatasetError, Recipe
from datagen.recipe.recipe import merge_into
from scenes import FAMILIES
from scenes.user_assets.pool import Asset, AssetPool


def recipe(family: str = "flying_things", seed: int = 0, **scenes: int) -> Recipe:
    return Recipe(FAMILIES[family].config(), scenes, seed=seed)


def test_scenes_are_added_and_none_is_taken_away() -> None:
    merged = merge_into(recipe(train=5, val=2), recipe(train=3, test=4), "data")
    assert merged.scenes == {"train": 5, "val": 2, "test": 4}


def test_what_differs_is_said() -> None:
    with pytest.raises(DatasetError, match="data was rendered with seed 0, not 1: use the same settings"):
        merge_into(recipe(train=1), recipe(train=1, seed=1), "data")
    with pytest.raises(
        DatasetError, match=r"data was rendered with world\.family flying_things, not driving"
    ):
        merge_into(recipe(train=1), recipe("driving", train=1, seed=1), "data")


def test_many_user_assets_do_not_fill_the_message() -> None:
    """One file more among thousands was a sentence of 66 kB."""
    assets = tuple(Asset(f"{number}.obj", f"{number:064x}") for number in range(2000))
    wanted = recipe(train=1)
    some, more = (replace(wanted, assets=AssetPool(meshes=meshes)) for meshes in (assets[1:], assets))
    with pytest.raises(
        DatasetError, match=r"assets\.meshes \(1999 entries\), not \(2000 entries\)"
    ) as refused:
        merge_into(some, more, "data")
    assert len(str(refused.value)) <= 300

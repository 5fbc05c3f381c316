"""Recipes: what may be added to a folder that has one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from datagen import DatasetError, Recipe
from datagen.recipe.recipe import merge_into, read_recipe, write_recipe
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


def with_meshes(count: int) -> Recipe:
    """A recipe with so many user assets."""
    files = tuple(Asset(f"{number}.obj", f"{number:064x}", "train") for number in range(count))
    return replace(recipe(train=1), assets=AssetPool(meshes=files, share=0.3))


def test_many_user_assets_do_not_fill_the_message() -> None:
    """One file more among thousands was a sentence of 66 kB."""
    some, more = with_meshes(1999), with_meshes(2000)
    with pytest.raises(
        DatasetError, match=r"other user assets, there are now 1 more \(1999\.obj\): use the same"
    ) as refused:
        merge_into(some, more, "data")
    assert len(str(refused.value)) <= 300
    with pytest.raises(DatasetError, match=r"there are now 1 fewer \(1999\.obj\)"):
        merge_into(more, some, "data")


def test_a_recipe_with_ten_thousand_files_is_read_back(tmp_path: Path) -> None:
    """From about 9,100 files the recipe passed its own limit."""
    written, path = with_meshes(10_000), tmp_path / "recipe.yaml"
    write_recipe(path, written)
    assert read_recipe(path) == written
    assert path.stat().st_size < 2000
    assert read_recipe(path).settings_sha256() == written.settings_sha256()
    fewer = with_meshes(9_999)
    assert fewer.settings_sha256() != written.settings_sha256()


def test_a_recipe_is_refused_without_the_list_that_it_names(tmp_path: Path) -> None:
    path, pool = tmp_path / "recipe.yaml", tmp_path / "assets.json"
    write_recipe(path, with_meshes(3))
    text = pool.read_text()
    pool.write_text(text.replace("2.obj", "3.obj"))
    with pytest.raises(DatasetError, match="beside it is not the list of user assets that it names"):
        read_recipe(path)
    pool.unlink()
    with pytest.raises(DatasetError, match=r"there is no assets\.json beside it"):
        read_recipe(path)
    path.write_text(
        "world: {family: driving}\nscenes: {train: 1}\nassets: {meshes: [{name: a, sha256: b}]}\n"
    )
    with pytest.raises(DatasetError, match="lists user assets itself"):
        read_recipe(path)


def test_a_recipe_with_many_faults_is_refused_in_one_short_sentence(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(
        "world: {family: driving}\nscenes: {train: 1}\n" + "".join(f"setting_{k}: 1\n" for k in range(90))
    )
    with pytest.raises(DatasetError, match="is not a valid recipe") as refused:
        read_recipe(path)
    assert len(str(refused.value)) <= 300 + len(str(path))

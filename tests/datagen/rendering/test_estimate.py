"""Recipes that ship, dry runs and curricula."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from datagen import DatasetError, Recipe, StereoDataset, read_recipe, render_dataset
from datagen.dataset.layout import Layout
from datagen.dataset.manifest import read_manifest
from datagen.recipe.recipe import recipe_from_text, write_recipe
from datagen.rendering.estimate import estimate_run
from scenes import FAMILIES, FamilyConfig
from scenes.shapes.solids.basic import Box, Superquadric
from scenes.shapes.solids.revolved import Cylinder
from stereoforge.cli import main

FOLDER = Path(__file__).parents[3] / "recipes"
RECIPES = [path for path in sorted(FOLDER.glob("*.yaml")) if "\ndomains:" not in path.read_text()]
"""Of data sets; studies have recipes of another kind."""
WORLD = FAMILIES["flying_things"].config(
    width=96,
    height=54,
    frames=2,
    flying_objects=(3, 3),
    background_objects=(4, 4),
    background_materials=(2, 2),
)
RECIPE = Recipe(WORLD, {"train": 3, "test": 2}, samples=1)


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_shipped_recipes_are_valid_and_give_scenes(path: Path) -> None:
    recipe = read_recipe(path)
    assert recipe.sample("train", 0).family == recipe.family


def test_there_is_a_recipe_and_a_quick_one_for_each_family() -> None:
    recipes = {path.stem: read_recipe(path) for path in RECIPES}
    for family in FAMILIES:
        quick = [name.startswith("cpu_") for name, recipe in recipes.items() if recipe.family == family]
        assert {True, False} <= set(quick), family


def test_a_split_of_a_recipe_has_the_recipes_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "recipe.yaml"
    write_recipe(path, RECIPE)
    flags = ["render", "--recipe", str(path), "--out", str(tmp_path / "set"), "--dry-run", "--split"]
    with pytest.raises(SystemExit) as end:
        main([*flags, "test"])
    assert end.value.code == 0
    assert "2 test scenes" in " ".join(capsys.readouterr().out.split())
    with pytest.raises(SystemExit) as end:
        main([*flags, "val"])
    assert end.value.code == 2
    assert "no scenes of split val" in " ".join(capsys.readouterr().err.split())


def test_a_dry_run_counts_what_is_missing_and_measures_one_frame(tmp_path: Path) -> None:
    root = tmp_path / "set"
    before = estimate_run(RECIPE, root)
    assert not root.exists()
    assert (before.missing, before.already_there, before.frames) == ({"train": 3, "test": 2}, 0, 10)
    render_dataset(replace(RECIPE, scenes={"train": 2}), root, workers=1)
    sizes = [
        sum(entry.size for entry in read_manifest(Layout(root).manifest("train", scene)).files)
        for scene in (0, 1)
    ]
    assert before.scene_bytes == pytest.approx(np.mean(sizes), rel=0.3)
    assert before.seconds == 5 * before.scene_seconds > 0
    sharded = estimate_run(RECIPE, root, shard=(1, 2))
    assert (sharded.missing, sharded.already_there) == ({"train": 0, "test": 1}, 1)
    done = estimate_run(replace(RECIPE, scenes={"train": 2}), root)
    assert (done.frames, done.seconds, done.bytes) == (0, 0, 0)
    assert len(StereoDataset(root, "train")) == 4


def test_a_curriculum_goes_from_few_and_plain_to_the_family_s_own() -> None:
    world = FAMILIES["flying_things"].config(flying_objects=(20, 20), background_objects=(50, 50))
    recipe = Recipe(world, {"train": 10}, curriculum_scenes=8)
    scenes = [recipe.sample("train", index) for index in (0, 4, 8)]
    flying = [scene.notes["flying_objects"] for scene in scenes]
    assert flying == [2, 11, 20]
    assert [scene.notes["background_objects"] for scene in scenes] == [5, 28, 50]
    plain = [
        np.mean(
            [isinstance(thing.shape, Box | Cylinder | Superquadric) for thing in scene.objects[-int(count) :]]
        )
        for scene, count in zip(scenes, flying, strict=True)
    ]
    assert plain[0] == 1 > plain[2]
    # Scenes after the ramp are those of the recipe without one, whatever the set's size, and so are all that are
    # validated and tested on.
    without = replace(recipe, curriculum_scenes=0)
    assert scenes[2] == without.sample("train", 8)
    assert all(recipe.sample(split, 0) == without.sample(split, 0) for split in ("val", "test"))


@pytest.mark.parametrize("family", ["driving", "monkaa", "sintel"])
def test_every_family_has_a_curriculum_of_more_and_more_things(family: str) -> None:
    recipe = Recipe(FAMILIES[family].config(), {"train": 6}, curriculum_scenes=6)
    counts = [len(recipe.sample("train", index).objects) for index in (0, 1, 5, 6)]
    assert 1.5 * sum(counts[:2]) < sum(counts[2:])
    assert recipe.sample("train", 6) == replace(recipe, curriculum_scenes=0).sample("train", 6)


def test_a_curriculum_never_asks_for_nothing_where_there_was_something() -> None:
    simple = FAMILIES["monkaa"].config().at_complexity(0.0)
    assert (simple.creatures, simple.undergrowth) == ((1, 1), (3, 6))
    with pytest.raises(ValueError, match="from 0 to 1"):
        simple.at_complexity(1.5)


def test_a_family_that_names_no_crowd_has_no_curriculum_and_says_so() -> None:
    class Plain(FamilyConfig):
        pass

    assert Plain().at_complexity(1.0) == Plain()
    with pytest.raises(ValueError, match="Plain names no crowd"):
        Plain().at_complexity(0.5)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"gradient_threshold_px": 0.0}, "gradient_threshold_px must be above 0"),
        ({"gradient_threshold_px": float("nan")}, "gradient_threshold_px must be above 0"),
        ({"passes": ("clean", "clean")}, "passes name 'clean' 2 times"),
        ({"targets": ("normals", "colour")}, "targets must be among"),
        ({"world": replace(WORLD, width=20000, height=20000)}, "20000x20000 are too large"),
    ],
)
def test_recipes_that_make_no_sense_are_refused(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(DatasetError, match=sentence):
        replace(RECIPE, **change)


@pytest.mark.parametrize("text", ["", "- 1", "hello"])
def test_a_file_that_is_no_recipe_is_said_so(text: str) -> None:
    with pytest.raises(DatasetError, match=r"^it is not a valid recipe: it has no settings"):
        recipe_from_text(text.encode(), "it")

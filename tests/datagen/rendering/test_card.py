"""The card of a data set: what it says, and that it is the same however the set was rendered."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from datagen import StereoDataset, render_dataset
from datagen.dataset.layout import Layout
from datagen.rendering.card import CARD, LICENSES, MARK, PICTURE, compose_card
from datagen.verify.dataset_check import verify_dataset
from scenes.user_assets.pool import Asset, AssetPool
from stereoforge_kit.files import LocalTree
from tests.datagen.sabotage import ONE_WORKER, RECIPE

SMALL = replace(RECIPE, scenes={"train": 2, "test": 1})


def card_of(root: Path) -> tuple[bytes, bytes]:
    return (root / CARD).read_bytes(), (root / PICTURE).read_bytes()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("card") / "set"
    assert render_dataset(SMALL, root, executor=ONE_WORKER).failures == ()
    return root


def test_counts_statistics_and_hashes(whole: Path) -> None:
    text = (whole / CARD).read_text()
    assert text.startswith(MARK)
    assert "# flying_things, 64 x 36: 3 stereo pairs" in text
    assert "| train | 2 | 2 |" in text
    assert "| test | 1 | 1 |" in text
    assert "| val |" not in text
    assert SMALL.settings_sha256() in text
    medians = [np.median(sample.disparity_left) for sample in StereoDataset(whole, "train")]
    row = re.search(r"\| disparity, median \| ([0-9.]+) px \|", text)
    assert row is not None
    assert float(row[1]) == pytest.approx(np.mean(medians), abs=0.051)
    assert re.search(r"Made with blender [0-9.]+[^,]*, numpy", text)
    picture = iio.imread(whole / PICTURE)
    left = StereoDataset(whole, "train")[0].left
    np.testing.assert_array_equal(picture[:36, :64], left)
    assert picture.shape[0] == 3 * 36 + 2 * 4


def test_the_lines_that_load_it(whole: Path) -> None:
    """Three of them, and ours works."""
    block = (whole / CARD).read_text().split("```python\n")[1].split("```")[0].splitlines()
    assert [line.partition("(")[0] for line in block] == [
        "SceneFlowStereo",
        "SceneFlowDatasets",
        "StereoDataset",
    ]
    frames = eval(block[2].replace("PATH", str(whole)), {"StereoDataset": StereoDataset})
    assert len(frames) == 2


def test_shards_and_growth_give_the_same_card(whole: Path, tmp_path: Path) -> None:
    root = tmp_path / "set"
    render_dataset(replace(SMALL, scenes={"train": 1}), root, executor=ONE_WORKER)
    first = card_of(root)
    assert "| train | 1 | 1 |" in first[0].decode()
    for index in (1, 0):
        render_dataset(SMALL, root, executor=ONE_WORKER, shard=(index, 2))
    assert card_of(root) == card_of(whole)
    assert card_of(root) != first
    assert verify_dataset(root).problems == ()


def test_a_picture_that_was_lost_comes_back(tmp_path: Path) -> None:
    root, recipe = tmp_path / "set", replace(SMALL, scenes={"train": 1})
    render_dataset(recipe, root, executor=ONE_WORKER)
    before = card_of(root)
    (root / PICTURE).unlink()
    render_dataset(recipe, root, executor=ONE_WORKER)
    assert card_of(root) == before


def test_verify_finds_the_card_of_other_scenes(whole: Path, tmp_path: Path) -> None:
    root = tmp_path / "set"
    render_dataset(replace(SMALL, scenes={"train": 1}), root, executor=ONE_WORKER)
    card = root / CARD
    good = card.read_text()
    card.write_text((whole / CARD).read_text())
    (problem,) = verify_dataset(root).problems
    assert (problem.place, "is the card of other scenes" in str(problem)) == (CARD, True)
    render_dataset(replace(SMALL, scenes={"train": 1}), root, executor=ONE_WORKER)
    assert card.read_text() == good
    # Another version may have other words.
    card.write_text(good.replace("stereo pairs", "pairs"))
    assert verify_dataset(root).problems == ()
    # Somebody's own is neither judged nor replaced.
    card.write_text("# My set\n")
    render_dataset(replace(SMALL, scenes={"train": 1}), root, executor=ONE_WORKER)
    assert card.read_text() == "# My set\n"
    assert verify_dataset(root).problems == ()


def test_the_users_files_and_their_licences(analytic_dataset: Path, own_dataset: Path) -> None:
    text = compose_card(LocalTree(analytic_dataset)).text
    assert "Files of the user's" not in text
    recipe = own_dataset / "recipe.yaml"
    from datagen.recipe.recipe import read_recipe, write_recipe

    pool = AssetPool(
        meshes=(Asset("chair|1.obj", "ab" * 32, "train"),), textures=(Asset("wood.png", "cd" * 32, "train"),)
    )
    write_recipe(recipe, replace(read_recipe(recipe), assets=pool))
    text = compose_card(LocalTree(own_dataset)).text
    assert f"| mesh | chair 1.obj | `{'ab' * 32}` |" in text
    assert f"| texture | wood.png | `{'cd' * 32}` |" in text
    assert f"write them into `{LICENSES}`" in text
    many = replace(pool, meshes=tuple(Asset(f"{k}.obj", f"{k:064x}", "train") for k in range(300)))
    write_recipe(recipe, replace(read_recipe(recipe), assets=many))
    text = compose_card(LocalTree(own_dataset)).text
    assert text.count("| mesh |") == 100
    assert "And 201 more, which `assets.json` lists." in text
    (own_dataset / LICENSES).write_text("chair|1.obj: CC BY 4.0, Jane Doe\n")
    text = compose_card(LocalTree(own_dataset)).text
    assert "CC BY 4.0, Jane Doe" in text
    assert "write them into" not in text


def test_damaged_scenes_do_not_stop_a_card(own_dataset: Path) -> None:
    layout = Layout(own_dataset)
    whole = compose_card(LocalTree(own_dataset))
    assert whole.picture is not None
    layout.file("frames_cleanpass", "train", 1, "left", 6).write_bytes(b"")
    card = compose_card(LocalTree(own_dataset))
    assert (card.text, card.picture) == (whole.text, None)  # The picture that is there stays.
    layout.manifest("train", 0).write_text("{")
    assert "| train | 2 | 2 |" in compose_card(LocalTree(own_dataset)).text

"""verify --repair renders exactly the broken scenes again."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from datagen import Recipe, read_recipe, render_dataset
from datagen.dataset.layout import Layout
from datagen.errors import MachineError
from datagen.executors import Failure
from datagen.recipe.assets import prepare_mesh
from datagen.rendering.quarantine import put_in_quarantine, quarantined_scenes
from datagen.verify.repair import repair_dataset
from scenes import FAMILIES
from scenes.user_assets.pool import Asset, AssetPool
from stereoforge.cli import main
from stereoforge_kit.files import LocalTree
from tests.datagen.sabotage import ONE_WORKER, RECIPE, Sabotage, hashes

CHECKOUT = Path(__file__).parents[3]


def verify(root: Path, *flags: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(["verify", str(root), "--workers", "1", *flags])
    assert isinstance(end.value.code, int)
    return end.value.code


@pytest.mark.slow
def test_broken_scenes_and_no_others_are_rendered_again(
    small_reference: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    root = Path(shutil.copytree(small_reference, tmp_path / "set"))
    layout = Layout(root)
    untouched = layout.manifest("train", 0).read_bytes()
    disparity = layout.file("disparity", "train", 1, "left", 6)
    flipped = bytearray(disparity.read_bytes())
    flipped[500] ^= 1
    disparity.write_bytes(flipped)
    layout.manifest("train", 2).write_text("{}")
    for path in layout.scene_paths("train", 3):  # missing altogether: not broken, so not repair's business
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    # Nor is what lies in quarantine since the data set was rendered.
    put_in_quarantine(LocalTree(root), tmp_path, RECIPE, "train", 3, Failure("timeout", "ran too long"), 2)
    assert verify(root) == 1
    assert verify(root, "--repair") == 1
    said = capfd.readouterr()
    assert "rendering 2 scenes again" in " ".join(said.out.split())
    assert "are of no broken scene and are left" in said.err
    whole = hashes(small_reference)
    assert hashes(root) == {name: digest for name, digest in whole.items() if "/0003" not in name}
    assert layout.manifest("train", 0).read_bytes() == untouched


@pytest.mark.slow
def test_a_repaired_data_set_is_right_again(small_reference: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(small_reference, tmp_path / "set"))
    Layout(root).file("occlusion", "train", 1, "right", 6).write_bytes(b"")
    Layout(root).manifest("train", 2).write_text('{"family":')  # Its files then belong to no finished scene.
    assert verify(root, "--repair") == 0
    assert hashes(root) == hashes(small_reference)


def files(root: Path) -> dict[str, bytes]:
    """Every file of the data: no log."""
    found = (path for path in root.rglob("*") if path.is_file())
    named = {path.relative_to(root).as_posix(): path.read_bytes() for path in found}
    return {name: data for name, data in named.items() if not name.startswith("logs/")}


def repair(root: Path, capfd: pytest.CaptureFixture[str], *flags: str) -> tuple[int, str]:
    """Exit code and last words of a repair in this process."""
    capfd.readouterr()
    with pytest.raises(SystemExit) as end:
        main(["verify", str(root), "--repair", *flags])
    said = capfd.readouterr().err.splitlines()
    assert len(said) <= 1
    assert all(len(sentence) <= 300 + len(str(root)) for sentence in said)
    return int(end.value.code or 0), "".join(said)


def damage(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.fixture(scope="module")
def with_meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rendered scene with a mesh of the user's; not to be changed."""
    folder = tmp_path_factory.mktemp("own")
    original = folder / "mine.obj"
    original.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    asset = Asset("mine.obj", f"{0:064x}", "train")
    world = FAMILIES["flying_things"].config(width=64, height=36)
    recipe = Recipe(world, {"train": 1}, seed=1, samples=1, assets=AssetPool(meshes=(asset,)))
    render_dataset(replace(recipe, scenes={}), folder / "set")
    (folder / "set/assets").mkdir()
    np.savez(folder / f"set/assets/{asset.sha256}.npz", **prepare_mesh(original))
    assert render_dataset(recipe, folder / "set", executor=ONE_WORKER).failures == ()
    return folder / "set"


@pytest.mark.slow
def test_without_its_assets_a_set_keeps_every_file(
    with_meshes: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    root = Path(shutil.copytree(with_meshes, tmp_path / "set"))
    shutil.rmtree(root / "assets")
    before = files(root)
    code, said = repair(root, capfd)
    assert code == 1
    assert "no finished scene is known to be broken" in said
    assert files(root) == before
    damage(Layout(root).file("frames_cleanpass", "train", 0, "left", 6))
    before = files(root)
    code, said = repair(root, capfd)
    assert code == 1
    assert "has no whole prepared file of" in said
    assert files(root) == before


@pytest.mark.slow
def test_a_truncated_asset_costs_nothing(
    with_meshes: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    root = Path(shutil.copytree(with_meshes, tmp_path / "set"))
    for asset in (root / "assets").glob("*.npz"):
        asset.write_bytes(asset.read_bytes()[:200])
    damage(Layout(root).file("frames_cleanpass", "train", 0, "left", 6))
    before = files(root)
    code, said = repair(root, capfd, "--dry-run")
    assert code == 1
    assert "has no whole prepared file of" in said
    assert repair(root, capfd)[0] == 1
    assert files(root) == before


@pytest.mark.slow
def test_a_damaged_asset_puts_no_scene_in_quarantine(with_meshes: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(with_meshes, tmp_path / "set"))
    for asset in (root / "assets").glob("*.npz"):  # A damaged array in a file that is whole by its looks.
        content = bytearray(asset.read_bytes())
        content[150] ^= 1
        asset.write_bytes(content)
    recipe = read_recipe(root / "recipe.yaml")
    with pytest.raises(MachineError, match="is damaged"):
        render_dataset(replace(recipe, scenes={"train": 8}), root, executor=ONE_WORKER)
    assert quarantined_scenes(LocalTree(root)) == []


BLOCK = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "bpy":
            raise ModuleNotFoundError("No module named 'bpy'", name="bpy")
sys.meta_path.insert(0, Blocked())
"""


@pytest.mark.slow
@pytest.mark.parametrize("module", ["sitecustomize", "bpy"])
def test_a_machine_without_blender_touches_nothing(
    small_reference: Path, tmp_path: Path, module: str
) -> None:
    root = Path(shutil.copytree(small_reference, tmp_path / "set"))
    damage(Layout(root).file("disparity", "train", 1, "left", 6))
    before = files(root)
    (tmp_path / "hidden").mkdir()
    raising = "raise ModuleNotFoundError(\"No module named 'bpy'\", name='bpy')"
    (tmp_path / f"hidden/{module}.py").write_text(BLOCK if module == "sitecustomize" else raising)
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path / 'hidden'}{os.pathsep}{CHECKOUT}"}
    ended = subprocess.run(
        [sys.executable, "-m", "stereoforge", "verify", str(root), "--repair", "--geometry-pixels", "0"],
        env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert ended.returncode == 1
    assert ended.stderr.startswith("stereoforge: rendering needs Blender"), ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert files(root) == before


@pytest.mark.slow
def test_a_dry_run_says_what_would_be_done(
    small_reference: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    root = Path(shutil.copytree(small_reference, tmp_path / "set"))
    damage(Layout(root).file("disparity", "train", 1, "left", 6))
    before = files(root)
    code, said = repair(root, capfd, "--dry-run")
    assert code == 1
    assert "--repair would render 1 scenes again: train/0001" in said
    assert files(root) == before


def test_a_recipe_that_no_scene_was_rendered_by_replaces_none(
    small_reference: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    root = Path(shutil.copytree(small_reference, tmp_path / "set"))
    recipe = root / "recipe.yaml"
    recipe.write_text(recipe.read_text().replace("seed: 3", "seed: 4"))
    before = files(root)
    code, said = repair(root, capfd)
    assert code == 1
    assert "is not the recipe that any of the scenes was rendered by" in said
    assert files(root) == before


@pytest.mark.slow
def test_a_scene_that_cannot_be_rendered_again_stays_as_it_is(small_reference: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(small_reference, tmp_path / "set"))
    damage(Layout(root).file("disparity", "train", 1, "left", 6))
    before = files(root)
    summary = repair_dataset(root, [("train", 1)], executor=Sabotage(ONE_WORKER, {"train/0001": "raise"}))
    assert [entry.reason for entry in summary.failures] == ["RuntimeError: out of ideas"]
    assert files(root) == before
    Layout(root).manifest("train", 2).unlink()  # Whoever lost it has all the rest of the scene.
    before = files(root)
    summary = render_dataset(RECIPE, root, executor=Sabotage(ONE_WORKER, {"train/0002": "raise"}))
    assert len(summary.failures) == 1
    for card in ("README.md", "card.png"):  # They say how many scenes are finished.
        del before[card]
    assert before.items() <= files(root).items()

"""Data sets: the same bytes every time, however the work was spread or interrupted; clear refusals."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from datagen import DatasetError, Recipe, StereoDataset, read_recipe, render_dataset
from datagen.dataset.layout import Layout
from scenes import FAMILIES
from tests.datagen.sabotage import hashes

CONFIG = FAMILIES["flying_things"].config
RECIPE = Recipe(CONFIG(width=96, height=54, frames=2), {"train": 3, "test": 2}, seed=5, samples=2)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("reference") / "set"
    summary = render_dataset(RECIPE, root, workers=1)
    assert (summary.rendered, summary.already_there, summary.failures) == (5, 0, ())
    return root


@pytest.mark.slow
def test_same_recipe_same_bytes_with_other_workers(reference: Path, tmp_path: Path) -> None:
    render_dataset(RECIPE, tmp_path / "set", workers=2)
    assert hashes(tmp_path / "set") == hashes(reference)


@pytest.mark.slow
def test_killed_run_continues_to_the_same_bytes(reference: Path, tmp_path: Path) -> None:
    root = tmp_path / "set"
    code = (
        "from tests.datagen.rendering.test_render import RECIPE\nfrom datagen import render_dataset\n"
        f"if __name__ == '__main__':\n    render_dataset(RECIPE, {str(root)!r}, workers=1)\n"
    )
    script = tmp_path / "run.py"
    script.write_text(code)
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd())}
    process = subprocess.Popen([sys.executable, str(script)], env=environment, start_new_session=True)
    deadline = time.monotonic() + 60
    while not Layout(root).committed_scenes("train") and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    # What a kill between moving a scene's folders and writing its manifest leaves behind.
    orphan = Layout(root).file("disparity", "test", 1, "left", 6)
    orphan.parent.mkdir(parents=True, exist_ok=True)
    orphan.write_bytes(b"half")
    before = sum(len(Layout(root).committed_scenes(split)) for split in ("train", "test"))
    assert 0 < before < 5
    summary = render_dataset(RECIPE, root, workers=2)
    assert (summary.rendered, summary.already_there) == (5 - before, before)
    assert hashes(root) == hashes(reference)


def test_a_finished_set_renders_nothing_and_can_grow(reference: Path, tmp_path: Path) -> None:
    root = tmp_path / "set"
    shutil.copytree(reference, root)
    assert render_dataset(RECIPE, root).rendered == 0
    before = hashes(root)
    summary = render_dataset(replace(RECIPE, scenes={"val": 1}), root, workers=1)
    assert summary.rendered == 1
    assert read_recipe(root / "recipe.yaml").scenes == {"train": 3, "val": 1, "test": 2}
    del before["recipe.yaml"]
    assert before.items() <= hashes(root).items()


def test_a_process_in_which_blender_runs_can_still_spawn_workers(tmp_path: Path) -> None:
    code = (
        "from tests.datagen.rendering.test_render import RECIPE, replace, render_dataset\n"
        "if __name__ == '__main__':\n    import bpy\n"
        f"    summary = render_dataset(replace(RECIPE, scenes={{'test': 1}}), {str(tmp_path / 'set')!r}, workers=1)\n"
        "    assert summary.rendered == 1, summary\n"
    )
    (tmp_path / "run.py").write_text(code)
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd())}
    done = subprocess.run([sys.executable, str(tmp_path / "run.py")], env=environment, capture_output=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_shards_make_up_the_whole(reference: Path, tmp_path: Path) -> None:
    for index in range(2):
        render_dataset(RECIPE, tmp_path / "set", workers=1, shard=(index, 2))
    assert hashes(tmp_path / "set") == hashes(reference)


def test_samples_differ_between_scenes_frames_and_splits(reference: Path) -> None:
    samples = [sample for split in ("train", "test") for sample in StereoDataset(reference, split)]
    assert len(samples) == 10
    assert len({sample.left.tobytes() for sample in samples}) == 10
    assert len({sample.disparity_left.tobytes() for sample in samples}) == 10


def test_other_settings_in_the_same_folder_are_refused(reference: Path) -> None:
    with pytest.raises(DatasetError, match="seed 5, not 6"):
        render_dataset(replace(RECIPE, seed=6), reference)
    with pytest.raises(DatasetError, match=r"world\.width 96, not 128"):
        render_dataset(replace(RECIPE, world=CONFIG(width=128, height=54, frames=2)), reference)


def test_a_folder_with_something_else_in_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("do not touch")
    with pytest.raises(DatasetError, match="neither empty nor a data set"):
        render_dataset(RECIPE, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("world: {family: flying_things, width: 0}\nscenes: {train: 1}\n", "width must be at least 1"),
        ("world: {family: swimming_things}\nscenes: {train: 1}\n", "flying_things"),
        ("world: {family: flying_things}\nscenes: {train: 1}\nsede: 4\n", "sede"),
        ("world: {family: flying_things}\nscenes: {dev: 1}\n", "there is no split 'dev'"),
        ("- just\n- a list\n", "not a valid recipe"),
        ("a: [1\n", r"cannot read the recipe .*: line 2: expected ',' or ']', but got '<stream end>'$"),
    ],
)
def test_a_broken_recipe_is_refused_in_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(text)
    with pytest.raises(DatasetError, match=sentence) as refusal:
        read_recipe(path)
    assert "recipe.yaml" in str(refusal.value)
    assert "\n" not in str(refusal.value)

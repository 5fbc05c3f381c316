"""A fault of the machine or of the calling script stops a run in one sentence and is put down to no scene."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from datagen import render_dataset
from datagen.errors import MachineError
from datagen.rendering.quarantine import quarantined_scenes
from stereoforge_kit.files import LocalTree
from tests.datagen.sabotage import ONE_WORKER, RECIPE, Sabotage, hashes

ROOT = Path(__file__).parents[3]
SCRIPT = """
from pathlib import Path
from datagen import render_dataset
from tests.datagen.sabotage import ONE_WORKER, RECIPE
from dataclasses import replace
def main():
    print(render_dataset(replace(RECIPE, scenes={"train": 1}), Path("set"), executor=ONE_WORKER).rendered, "rendered")
"""
RENDER = ["render", "--scenes", "1", "--size", "64x36", "--samples", "1", "--workers", "1"]


def python(folder: Path, *words: str, path: tuple[Path, ...] = ()) -> subprocess.CompletedProcess[str]:
    """Python in a folder with this checkout on its path, after what is to hide modules of the checkout's Python."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (*path, ROOT)))}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )


def without_blender(folder: Path) -> Path:
    """A folder that, on Python's path, makes this a machine without bpy."""
    folder.mkdir()
    (folder / "bpy.py").write_text("raise ModuleNotFoundError(\"No module named 'bpy'\", name='bpy')\n")
    return folder


@pytest.mark.slow
def test_a_script_without_main_guard_is_told_so_and_renders_once_it_has_one(tmp_path: Path) -> None:
    script = tmp_path / "make.py"
    script.write_text(SCRIPT + "main()\n")
    ended = python(tmp_path, "make.py")
    assert ended.returncode == 1
    assert 'if __name__ == "__main__":' in ended.stderr
    assert "MachineError" in ended.stderr.splitlines()[-1]
    assert ended.stderr.count("Traceback") == 1  # none of the worker's
    assert quarantined_scenes(LocalTree(tmp_path / "set")) == []
    script.write_text(SCRIPT + 'if __name__ == "__main__":\n    main()\n')
    ended = python(tmp_path, "make.py")
    assert ended.stdout == "1 rendered\n", ended.stderr


def test_a_machine_without_blender_is_told_so_before_anything_is_written(tmp_path: Path) -> None:
    hidden = without_blender(tmp_path / "hidden")
    words = ("-m", "stereoforge", *RENDER, "--out", "set")
    ended = python(tmp_path, *words, path=(hidden,))
    assert ended.returncode == 1
    assert "rendering needs Blender" in ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert quarantined_scenes(LocalTree(tmp_path / "set")) == []


@pytest.mark.parametrize("number", [errno.EACCES, errno.EROFS, errno.EIO, errno.EMFILE])
def test_what_the_system_refuses_is_no_fault_of_a_scene(tmp_path: Path, number: int) -> None:
    broken = Sabotage(ONE_WORKER, {f"train/000{k}": f"errno {number}" for k in range(4)})
    with pytest.raises(MachineError, match=os.strerror(number)) as stopped:
        render_dataset(RECIPE, tmp_path / "set", executor=broken)
    assert len(str(stopped.value)) <= 300
    assert quarantined_scenes(LocalTree(tmp_path / "set")) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["run_{x}", "run_{fps}", "set #3 %d [a]*"])
def test_blender_never_sees_the_users_path(tmp_path: Path, name: str, small_reference: Path) -> None:
    one = type(RECIPE)(RECIPE.world, {"train": 1}, seed=RECIPE.seed, samples=1)
    assert render_dataset(one, tmp_path / name, executor=ONE_WORKER).failures == ()
    made = hashes(tmp_path / name)
    expected = hashes(small_reference)
    assert {k: v for k, v in made.items() if k != "recipe.yaml"} == {
        k: v for k, v in expected.items() if "/0000" in k
    }
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.slow
def test_two_slashes_are_a_path_like_any_other(tmp_path: Path) -> None:
    one = type(RECIPE)(RECIPE.world, {"train": 1}, seed=RECIPE.seed, samples=1)
    assert render_dataset(one, f"/{tmp_path}/set", executor=ONE_WORKER).failures == ()
    assert (tmp_path / "set/recipe.yaml").is_file()

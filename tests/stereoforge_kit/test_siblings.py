"""Folders of other projects that are called as our packages are."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import stereoforge_kit
from stereoforge_kit.siblings import check_siblings

HOME = Path(stereoforge_kit.__file__).resolve().parent.parent


def python(folder: Path, *words: str, path: str = str(HOME)) -> subprocess.CompletedProcess[str]:
    """A Python that is started in a folder and finds our packages behind what lies there."""
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True
    )


def strange_package(folder: Path, name: str) -> Path:
    (folder / name).mkdir(parents=True)
    (folder / name / "__init__.py").write_text("Model = object\n")
    return folder / name


@pytest.mark.parametrize(
    ("strange", "statement"),
    [("scenes", "from datagen import StereoDataset"), ("refine", "from training.presets import find_preset")],
)
def test_a_script_beside_a_package_of_our_name_is_told_which_folder(
    strange: str, statement: str, tmp_path: Path
) -> None:
    place = strange_package(tmp_path, strange)
    (tmp_path / "script.py").write_text(f"{statement}\n")
    done = python(tmp_path, "script.py")
    assert done.returncode == 1
    said = done.stderr.strip().splitlines()[-1].partition(": ")[2]
    assert said.startswith(f"{place} is in the way: ")
    assert len(said) <= 300


def test_the_command_never_looks_into_the_current_folder(tmp_path: Path) -> None:
    for name in ("scenes", "datagen", "training", "refine"):
        strange_package(tmp_path, name)
    (tmp_path / "empty").mkdir()
    for path in (str(HOME), f"{os.pathsep}{HOME}"):
        done = python(tmp_path, "-m", "stereoforge", "verify", "empty", path=path)
        assert done.returncode == 1
        assert done.stderr.startswith("stereoforge: empty: ")


def test_the_command_says_which_package_stands_before_ours(tmp_path: Path) -> None:
    place = strange_package(tmp_path / "other", "training")
    path = f"{place.parent}{os.pathsep}{HOME}"
    done = python(tmp_path, "-m", "stereoforge", "verify", "set", path=path)
    assert done.returncode == 1
    assert done.stderr.startswith(f"stereoforge: {place} is in the way: ")
    assert len(done.stderr.splitlines()) == 1


def test_our_own_folder_may_be_the_current_one() -> None:
    done = python(HOME, "-m", "stereoforge", "--version", path="")
    assert done.returncode == 0
    check_siblings(stereoforge_kit.__file__, "scenes", "datagen", "training", "refine", "no_such_package")

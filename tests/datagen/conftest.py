"""Data sets that several test modules read."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from datagen import Recipe, render_dataset
from scenes import FAMILIES
from tests.datagen.analytic_world import write_dataset
from tests.datagen.sabotage import ONE_WORKER, RECIPE


@pytest.fixture(scope="session")
def analytic_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two train scenes and one test scene of two frames each; not to be changed."""
    root = tmp_path_factory.mktemp("analytic") / "set"
    write_dataset(root, {"train": 2, "test": 1})
    return root


@pytest.fixture
def own_dataset(analytic_dataset: Path, tmp_path: Path) -> Path:
    """A copy of the analytic data set to damage."""
    return Path(shutil.copytree(analytic_dataset, tmp_path / "set"))


@pytest.fixture(scope="session")
def rendered_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One train and one test scene of flying_things, rendered by Blender; not to be changed."""
    root = tmp_path_factory.mktemp("rendered") / "set"
    world = FAMILIES["flying_things"].config(width=160, height=90)
    summary = render_dataset(Recipe(world, {"train": 1, "test": 1}, seed=1, samples=1), root, workers=1)
    assert summary.failures == ()
    return root


@pytest.fixture(scope="session")
def small_reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `sabotage.RECIPE` gives when nothing goes wrong; not to be changed."""
    root = tmp_path_factory.mktemp("small") / "set"
    assert render_dataset(RECIPE, root, executor=ONE_WORKER).failures == ()
    return root

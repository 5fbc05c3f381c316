"""Data sets that several test modules read."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.datagen.analytic_world import write_dataset


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

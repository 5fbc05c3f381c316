"""The examples in the docstrings of the public packages, run as they stand there."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("refine", "datagen.formats", "training.networks")
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def modules_with_examples(package: str) -> list[str]:
    """Names of a package's modules, itself included, whose text holds a prompt; nothing is imported."""
    paths = sorted((ROOT / package.replace(".", "/")).rglob("*.py"))
    with_prompt = (path for path in paths if ">>> " in path.read_text(encoding="utf-8"))
    names = (path.relative_to(ROOT).with_suffix("").parts for path in with_prompt)
    return [".".join(parts).removesuffix(".__init__") for parts in names]


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_shows_how_it_is_used(package: str) -> None:
    assert modules_with_examples(package)


@pytest.mark.parametrize("name", [name for package in PACKAGES for name in modules_with_examples(package)])
def test_the_examples_hold(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    module = importlib.import_module(name)
    monkeypatch.chdir(tmp_path)  # examples may write files
    failed, attempted = doctest.testmod(module, optionflags=FLAGS)
    assert attempted
    assert not failed

"""The examples in the docstrings run, and every writer has one."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import datagen.formats

MODULES = sorted(module.name for module in pkgutil.iter_modules(datagen.formats.__path__))


@pytest.mark.parametrize("name", MODULES)
def test_examples_give_what_they_say(name: str) -> None:
    failed, _ = doctest.testmod(importlib.import_module(f"datagen.formats.{name}"))
    assert failed == 0


@pytest.mark.parametrize("name", [name for name in datagen.formats.__all__ if name.startswith("write_")])
def test_a_writer_has_an_example(name: str) -> None:
    (found,) = doctest.DocTestFinder(recurse=False).find(getattr(datagen.formats, name), name)
    assert any("read_" in example.source for example in found.examples)

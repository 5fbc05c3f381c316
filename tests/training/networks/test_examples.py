"""The examples in the docstrings of `training.networks` give what they say."""

import doctest
import importlib
import pkgutil

import pytest

import training.networks

MODULES = [
    "training.networks",
    *(
        module.name
        for module in pkgutil.walk_packages(training.networks.__path__, "training.networks.")
        if not module.ispkg
    ),
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name: str) -> None:
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert failed == 0
    assert tried > 0

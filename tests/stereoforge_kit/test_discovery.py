"""Plug-ins are found in sub-packages, and a module's folder does not decide its place."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from stereoforge_kit.discovery import modules_in


@pytest.mark.parametrize("folder", ["", "late", "early"])
def test_modules_of_sub_packages_are_found_in_the_order_of_their_own_names(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sampling draws by position: a module that moves to another folder must not change the scenes."""
    package = f"plug_ins_{folder or 'flat'}"
    for path in (f"{package}/a.py", f"{package}/{folder}/b.py", f"{package}/zoo/c.py"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text("")
        (tmp_path / path).with_name("__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    found = modules_in(importlib.import_module(package))
    assert [module.__name__.rpartition(".")[2] for module in found] == ["a", "b", "c"]

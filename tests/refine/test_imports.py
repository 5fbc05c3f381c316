"""`refine` is a library of its own: light to import."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = ("torch", "bpy", "pytorch_lightning", "numba", "pyamg")


@pytest.mark.parametrize("module", ["refine", "refine.metrics", "refine.report.write"])
def test_importing_refine_pulls_in_neither_torch_nor_bpy(module):
    code = f"import sys, {module}; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

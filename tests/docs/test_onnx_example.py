"""The example of `docs/examples`: exported networks and the refinement, without torch."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from datagen.formats import read_pfm, write_png
from refine import refine_disparity
from tests.training.prediction.test_predictor import save_run
from training.prediction.onnx_export import export_model
from training.prediction.predictor import StereoPredictor

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "onnx_refine.py"
WITHOUT_TORCH = """
import importlib.abc, runpy, sys

class NoTorch(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "torch":
            raise ImportError("there is no torch here")

sys.meta_path.insert(0, NoTorch())
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def test_refining_without_torch_is_the_same(tmp_path: Path) -> None:
    save_run(tmp_path, "costvolume")
    exported = export_model(tmp_path, tmp_path / "onnx")
    left, right = np.random.default_rng(0).integers(0, 256, (2, 128, 192, 3), np.uint8)
    for name, view in (("left", left), ("right", right)):
        write_png(tmp_path / f"{name}.png", view)
    words = [EXAMPLE, exported.path, tmp_path / "left.png", tmp_path / "right.png", tmp_path / "out.pfm"]
    subprocess.run([sys.executable, "-c", WITHOUT_TORCH, *map(str, words)], check=True, timeout=300)

    predictor = StereoPredictor(tmp_path, max_disparity=192)
    predictor.networks[0].enlarged_to_pixels = None  # the model takes pictures as they are
    found = predictor.predict(left, right)
    assert found.confidence is not None
    assert found.gradient is not None
    expected = refine_disparity(found.disparity, found.confidence, found.gradient, left)
    np.testing.assert_allclose(read_pfm(tmp_path / "out.pfm"), expected, atol=0.02)

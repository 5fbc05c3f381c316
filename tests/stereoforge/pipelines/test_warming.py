"""After `warm-up`, nothing that a first pair or scene needs is left to compile."""

from __future__ import annotations

import subprocess
import sys

import pytest

from stereoforge.cli import main
from stereoforge.pipelines.warming import STAGES

PAIR = """
import numpy as np
from refine import MRFParameters, refine_disparity
from refine.mrf.robust import solve_robust
rng = np.random.default_rng(1)
disparity = rng.uniform(0, 40, (150, 260)).astype(np.float32)
confidence = rng.uniform(0, 1, disparity.shape).astype(np.float32)
gradient = rng.normal(0, 1, (*disparity.shape, 2)).astype(np.float32)
image = rng.integers(0, 255, (*disparity.shape, 3), np.uint8)
refine_disparity(disparity, confidence, gradient, image)
solve_robust(disparity, confidence, gradient, image, MRFParameters(), scale=0.1)
"""
SCENE = """
import numpy as np
from datagen.ground_truth.scene_geometry import build_geometry
from scenes import FAMILIES, sample_scene
for family in sorted(FAMILIES):
    scene = sample_scene(np.random.default_rng(1), family)
    build_geometry(scene)
    for material in scene.materials:
        material.color.image()
"""
COUNT = """
import gc
from numba.core.dispatcher import Dispatcher
kernels = [one for one in gc.get_objects() if issubclass(type(one), Dispatcher)]
kernels = [one for one in kernels if one.__module__.startswith(("refine", "scenes"))]
print(sum(sum(one.stats.cache_hits.values()) for one in kernels), *(
    one.__name__ for one in kernels if one.stats.cache_misses
))
"""


@pytest.mark.slow
@pytest.mark.parametrize("program", [PAIR, SCENE], ids=["pair", "scene"])
def test_nothing_is_left_to_compile(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["warm-up"])
    assert end.value.code == 0
    said = capsys.readouterr().out
    assert all(f"{stage}: " in said for stage in STAGES)
    done = subprocess.run([sys.executable, "-c", program + COUNT], capture_output=True, text=True, check=True)
    loaded, *compiled = done.stdout.split()
    assert int(loaded) > 5
    assert compiled == []

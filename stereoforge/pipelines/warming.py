"""Compiles ahead what the first pair, the first scene and the first evaluation would wait for."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

import numpy as np

PAIR_SIZE = 120, 160
"""Height and width of a pair that is refined to compile; smaller ones are solved directly, without the kernels."""


def refine_a_pair() -> None:
    """Solve every form of the MRF once, as `refine` and `evaluate` do."""
    from refine.energy.parameters import MRFParameters
    from refine.mrf.robust import solve_robust
    from refine.mrf.solve import solve_mrf

    rng = np.random.default_rng(0)
    disparity = rng.uniform(0, 20, PAIR_SIZE).astype(np.float32)
    confidence = rng.uniform(0, 1, disparity.shape).astype(np.float32)
    gradient = np.zeros((*disparity.shape, 2), np.float32)
    image = rng.integers(0, 255, (*disparity.shape, 3), np.uint8)
    inputs = disparity, confidence, gradient, image
    parameters = MRFParameters()
    solve_robust(*inputs, parameters, scale=0.1, solver="multigrid")
    for solver in ("multigrid", "cg"):
        solve_mrf(*inputs, parameters, "exact", solver)
        solve_mrf(*inputs, parameters, "paper", solver)


def make_scenes() -> None:
    """Sample a scene of every family, and build its meshes and textures, as `render` does."""
    from datagen.ground_truth.scene_geometry import build_geometry
    from scenes import FAMILIES, sample_scene

    for family in sorted(FAMILIES):
        scene = sample_scene(np.random.default_rng(0), family)
        build_geometry(scene)
        for material in scene.materials:
            material.color.image()


STAGES: dict[str, Callable[[], None]] = {"refining": refine_a_pair, "making scenes": make_scenes}
"""What is compiled, in words."""


def warm_up() -> Iterator[tuple[str, float]]:
    """Go through all stages, side by side; yields each stage's name and seconds as it ends.

    Raises:
        Exception: what a stage raises.
    """
    # A process of its own for each: numba compiles in one thread.
    with ProcessPoolExecutor(len(STAGES), mp_context=get_context("spawn")) as pool:
        running = {pool.submit(_timed, name): name for name in STAGES}
        for ended in as_completed(running):
            yield running[ended], ended.result()


def _timed(name: str) -> float:
    began = time.monotonic()
    STAGES[name]()
    return time.monotonic() - began

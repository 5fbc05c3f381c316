"""Statistics against values known without measuring."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from datagen.dataset.samples import StereoDataset
from datagen.dataset.statistics import measure, textured_share
from tests.datagen.analytic_world import make_scene, render


def test_of_a_set_are_those_of_its_closed_forms(analytic_dataset: Path) -> None:
    measured = measure(StereoDataset(analytic_dataset, "train"))
    views = [render(make_scene(scene), "left", instant) for scene in (0, 1) for instant in (0, 1)]
    assert len(measured) == 4
    np.testing.assert_allclose(measured.occluded, [(view.occlusion == 1).mean() for view in views])
    np.testing.assert_allclose(measured.out_of_frame, [(view.occlusion == 2).mean() for view in views])
    np.testing.assert_array_equal(measured.visible_objects, [3, 3, 3, 3])
    everything = np.concatenate([view.disparity.ravel() for view in views])
    for quantile in (0.05, 0.5, 0.95):
        exact = np.quantile(everything, quantile)
        assert np.quantile(measured.disparity, quantile) == pytest.approx(exact, abs=0.5)


def test_texture_is_what_deviates_enough() -> None:
    rng = np.random.default_rng(0)
    flat = np.full((60, 80, 3), 90, np.uint8)
    assert textured_share(flat) == 0
    # Uniform noise over 2a + 1 levels has the standard deviation sqrt(a (a + 1) / 3).
    faint = flat + rng.integers(-2, 3, (60, 80, 1)).astype(np.int8).astype(np.uint8)
    assert textured_share(faint) < 0.01
    strong = flat + rng.integers(-10, 11, (60, 80, 1)).astype(np.int8).astype(np.uint8)
    assert textured_share(strong) > 0.99
    half = flat.copy()
    half[:, :40] = strong[:, :40]
    assert textured_share(half) == pytest.approx(0.5, abs=0.06)

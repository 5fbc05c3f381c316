"""The field's protocol, held against its own few lines of numpy."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from refine.evaluation.evaluate import EvaluationOptions, evaluate
from refine.evaluation.results import EvaluatedSet
from refine.method import EvaluationFrame
from refine.registry import default_methods
from stereoforge.pipelines.generalization import (
    COLUMNS,
    counted_truth,
    generalization_rows,
    outlier_px,
    write_generalization,
)

SIZE = (24, 32)


def frame(seed: int, occluded: bool) -> EvaluationFrame:
    """Truth with infinity, unknown pixels and some beyond the range; an estimate that is off by 0 to 6 px."""
    rng = np.random.default_rng(seed)
    truth = rng.uniform(1, 220, SIZE).astype(np.float32)
    truth[:3], truth[3:6] = 0, np.nan
    estimate = np.nan_to_num(truth) + rng.uniform(-6, 6, SIZE).astype(np.float32)
    occlusion = rng.integers(0, 3, SIZE, np.uint8) * np.uint8(occluded)
    return EvaluationFrame(f"frame {seed}", np.zeros((*SIZE, 3), np.uint8), truth, occlusion, estimate)


def expected(frames: list[EvaluationFrame], threshold: float) -> list[float]:
    """EPE, then outliers among occluded, visible and all pixels, as stereo-toolbox computes them."""
    figures: list[list[float]] = [[], [], [], []]
    for each in frames:
        counted: NDArray[np.bool_] = (np.nan_to_num(each.truth) > 0) & (np.nan_to_num(each.truth) < 191)
        error = np.abs(each.disparity - each.truth)
        figures[0].append(error[counted].mean())
        masks = (counted & (each.occlusion > 0), counted & (each.occlusion == 0), counted)
        for found, mask in zip(figures[1:], masks, strict=True):
            if mask.any():
                found.append(100 * (error[mask] > threshold).mean())
    return [float(np.mean(values)) if values else float("nan") for values in figures]


@pytest.mark.parametrize("family", ["kitti2015", "middlebury2006", "eth3d", "driving"])
def test_figures_are_the_means_of_the_frames(family: str, tmp_path: Path) -> None:
    frames = [frame(1, True), frame(2, False), frame(3, True)]
    threshold = outlier_px(family)
    evaluation = evaluate(
        map(counted_truth, frames),
        default_methods(("regressor",)),
        EvaluationOptions(bad_threshold=threshold),
    )
    sets = [EvaluatedSet("ours", evaluation, family)]
    (row,) = generalization_rows(sets[0])
    found = [row.epe, row.occluded, row.visible, row.all]
    np.testing.assert_allclose(found, expected(frames, threshold), rtol=1e-6)
    assert row.frames == 3
    assert row.outlier_px == threshold

    lines = list(csv.DictReader(write_generalization([row], tmp_path).open()))
    assert list(lines[0]) == list(COLUMNS)
    assert float(lines[0]["all"]) == pytest.approx(row.all)


def test_a_set_without_occlusion_has_no_figure_of_it() -> None:
    evaluation = evaluate([counted_truth(frame(5, False))], default_methods(("regressor",)))
    (row,) = generalization_rows(EvaluatedSet("ours", evaluation))
    assert np.isnan(row.occluded)
    assert row.visible == row.all

"""Missing and damaged files of a set that is evaluated: all are said before the first frame, or left out when asked."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from datagen import DatasetError
from datagen.sources.registry import open_source
from refine.methods.regressor import Regressor
from stereoforge.pipelines.prediction import Predictors
from stereoforge.pipelines.set_evaluation import evaluate_set, open_test_data
from tests.datagen.sources import published
from tests.stereoforge.pipelines.test_submission import SIZE, kitti_set
from training.prediction.predictor import Prediction

PREDICTOR = cast(
    Predictors,
    Predictors(
        SimpleNamespace(
            predict=lambda left, _: Prediction(np.full(left.shape[:2], 10, np.float32), None, None)
        ),
        None,
    ),
)


def broken_set(root: Path) -> Path:
    """Frames 0 to 4 of KITTI 2015, of which 1 lacks its right and 3 both pictures."""
    kitti_set(root, testing=False)
    for path in list(root.rglob("000000_10.png")):
        for number in range(2, 5):
            shutil.copy(path, path.with_name(f"{number:06d}_10.png"))
    for name in ("image_3/000001", "image_2/000003", "image_3/000003"):
        (root / "training" / f"{name}_10.png").unlink()
    return root


def test_all_that_is_missing_is_said_first(tmp_path: Path) -> None:
    root = broken_set(tmp_path / "kitti")
    with pytest.raises(DatasetError) as refusal:
        open_test_data([f"kitti2015:{root}"], "test")
    said = str(refusal.value)
    assert "missing: 3 files of 2 of its 5 frames (training/image_3/000001_10.png, training/image_2/0" in said
    assert "--skip-broken" in said
    assert len(said) <= 300


def test_the_other_frames_are_evaluated_when_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = broken_set(tmp_path / "kitti")
    damaged = root / "training/image_3/000004_10.png"
    damaged.write_bytes(damaged.read_bytes()[:50])
    (data,) = open_test_data([str(root)], "test", skip_broken=True)
    assert [frame.name for frame in data.frames] == ["000000_10", "000002_10", "000004_10"]
    with pytest.raises(DatasetError, match="000004_10"):
        evaluate_set(data, PREDICTOR, (Regressor(),))
    evaluated = evaluate_set(data, PREDICTOR, (Regressor(),), skip_broken=True)
    assert [frame.name for frame in evaluated.evaluation.frames] == ["000000_10", "000002_10"]
    assert "missing: 3 files of 2 of its 5 frames" in evaluated.facts["Left out"]
    assert "cannot be read: 1 of 3 frames" in evaluated.facts["Damaged"]
    said = capsys.readouterr().out
    assert "000001_10.png" in said
    assert "000004_10.png" in said
    assert data.frames[0].size == SIZE


def test_a_set_without_a_whole_frame(tmp_path: Path) -> None:
    root = broken_set(tmp_path / "kitti")
    shutil.rmtree(root / "training/image_3")
    (root / "training/image_3").mkdir()
    (data,) = open_test_data([str(root)], "test", skip_broken=True)
    with pytest.raises(DatasetError, match="no frame is left"):
        evaluate_set(data, PREDICTOR, (Regressor(),), skip_broken=True)


@pytest.mark.parametrize(
    ("make", "picture"),
    [
        (published.middlebury, "trainingQ/Adirondack/im0.png"),
        (published.middlebury, "trainingQ/Adirondack/im1.png"),
        (published.eth3d, "two_view_training/delivery_area_1l/im0.png"),
        (published.middlebury2003, "cones/im2.ppm"),
        (published.middlebury2003, "cones/im6.ppm"),
        (published.middlebury2006, "ThirdSize/Aloe/view1.png"),
        (published.sintel, "training/clean_right/alley_1/frame_0001.png"),
        (published.crestereo, "tree/0a1b_right.jpg"),
        (published.flyingthings3d, "frames_cleanpass/TEST/B/0017/right/0009.png"),
        (published.monkaa, "disparity/eating_x2/right/0000.pfm"),
    ],
)
def test_a_missing_picture_is_no_missing_frame(
    make: Callable[[Path], object], picture: str, tmp_path: Path
) -> None:
    make(tmp_path)
    (tmp_path / picture).unlink()
    with pytest.raises(DatasetError, match="missing: 1 file of 1 of its 1 frames"):
        open_test_data([f"{open_source(tmp_path).format.name}:{tmp_path}"], "test")

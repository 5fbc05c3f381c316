"""KITTI's submission folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from datagen.formats import read_png, write_png
from datagen.sources.stereo_frame import StereoFrame
from refine.evaluation.bootstrap import bootstrap
from refine.evaluation.evaluate import EvaluationFrame
from refine.methods.regressor import Regressor
from refine.report.paper_tables import paper_tables
from stereoforge.errors import UsageError
from stereoforge.pipelines.prediction import Image, Predictors
from stereoforge.pipelines.set_evaluation import evaluate_set, evaluation_options, open_test_data
from stereoforge.pipelines.submission import encode_disparity, find_submission, write_submission
from training.prediction.predictor import Prediction

SIZE = (20, 60)


@dataclass
class Brightness:
    """Predicts the left image's red."""

    def frame(self, sample: StereoFrame) -> EvaluationFrame:
        disparity = sample.left[..., 0].astype(np.float32)
        labels = np.zeros(sample.size, np.uint8)
        return EvaluationFrame(sample.name, sample.left, sample.disparity_left, labels, disparity)


def kitti_set(root: Path, testing: bool, edition: int = 2015) -> Path:
    images = ("image_2", "image_3") if edition == 2015 else ("colored_0", "colored_1")
    truths = "disp_occ_0" if edition == 2015 else "disp_occ"
    rng = np.random.default_rng(0)
    for part in ("training", "testing") if testing else ("training",):
        for number in range(2):
            for folder in images:
                path = root / part / folder / f"{number:06d}_10.png"
                path.parent.mkdir(parents=True, exist_ok=True)
                iio.imwrite(path, rng.integers(0, 256, (*SIZE, 3), np.uint8))
                iio.imwrite(path.with_name(f"{number:06d}_11.png"), np.zeros((*SIZE, 3), np.uint8))
            truth = root / "training" / truths / f"{number:06d}_10.png"
            truth.parent.mkdir(exist_ok=True)
            write_png(truth, np.full(SIZE, 2560, np.uint16))
    return root


@pytest.mark.parametrize("edition", [2012, 2015])
@pytest.mark.parametrize(("testing", "named"), [(True, ""), (False, ""), (True, "training")])
def test_the_folder_is_what_the_server_takes(tmp_path: Path, testing: bool, named: str, edition: int) -> None:
    """2012's server takes the files in the root, 2015's in `disp_0`."""
    root = kitti_set(tmp_path / "kitti", testing, edition)
    submission = find_submission([f"kitti{edition}:{root / named}"])
    count = write_submission(submission, Brightness(), Regressor(), tmp_path / "out")  # type: ignore[arg-type]
    assert count == 2
    assert (submission.note is None) == (testing and not named)
    if submission.note:
        assert "training part" in submission.note
    written = sorted(
        path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.png")
    )
    folder, images = ("disp_0/", "image_2") if edition == 2015 else ("", "colored_0")
    assert written == [f"{folder}000000_10.png", f"{folder}000001_10.png"]
    part = "testing" if testing and not named else "training"
    red = iio.imread(root / part / images / "000001_10.png")[..., 0].astype(int)
    values = read_png(tmp_path / "out" / written[1])
    assert values.dtype == np.uint16
    np.testing.assert_array_equal(values, np.maximum(red * 256, 1))


def test_kitti_sets_are_told_apart_and_judged_by_their_own_customs(tmp_path: Path) -> None:
    root = kitti_set(tmp_path / "kitti", testing=False)
    objects = np.zeros(SIZE, np.uint8)
    objects[:, 30:] = 7
    for number in range(2):
        path = root / "training" / "obj_map" / f"{number:06d}_10.png"
        path.parent.mkdir(exist_ok=True)
        write_png(path, objects)
    (data,) = open_test_data([str(root)], "test")
    assert (data.name, data.family) == ("kitti", "kitti2015")

    @dataclass
    class Wrong:
        """Right, but 2 px off on the background and 5 px off on the cars."""

        def predict(self, left: Image, right: Image) -> Prediction:  # noqa: ARG002
            return Prediction(10 + np.where(objects > 0, 5, 2).astype(np.float32), None, None)

    evaluated = evaluate_set(data, Predictors(Wrong(), None), (Regressor(),))
    score = evaluated.evaluation.scores["regressor"]
    assert (score.d1.background, score.d1.foreground, score.d1.all) == (0, 1, 0.5)
    assert score.regions["all"].bad == 0.5
    assert [table.number for table in paper_tables(evaluated)][-1] == 6
    assert bootstrap(evaluated.evaluation).scenes == 2
    assert evaluation_options("driving").bad_threshold == 1
    assert evaluation_options("kitti2015", 2.0).bad_threshold == 2


def test_sets_are_named_so_that_no_two_are_alike(tmp_path: Path) -> None:
    folders = [kitti_set(tmp_path / parent / "kitti", testing=False) for parent in ("a", "b")]
    names = [data.name for data in open_test_data([str(folder) for folder in folders], "test")]
    assert names == [str(folder) for folder in folders]


def test_zero_means_no_estimate_only() -> None:
    disparity = np.array([[np.nan, 0, 1 / 256, 1.5, 300, -2]], np.float32)
    assert encode_disparity(disparity).tolist() == [[0, 1, 1, 384, 65535, 1]]


def test_other_sets_cannot_be_submitted(tmp_path: Path) -> None:
    kitti = kitti_set(tmp_path / "kitti", testing=False)
    with pytest.raises(UsageError, match="exactly one KITTI data set, there are 2"):
        find_submission([str(kitti), f"kitti2015:{kitti}"])

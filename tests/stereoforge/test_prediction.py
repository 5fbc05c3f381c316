"""What predictors make of a frame, and how long they are said to take."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from datagen import StereoDataset
from datagen.export import EXPORTERS, ExportOptions
from datagen.sources.stereo_frame import FileFrame, FileFrames
from refine.baselines.regressor_f import RegressorF
from refine.methods.regressor import Regressor
from refine.report.paper_tables import paper_tables
from stereoforge.pipelines.prediction import Image, Predictors
from stereoforge.pipelines.set_evaluation import TestData, evaluate_set, open_test_data
from stereoforge_kit.files import open_tree
from tests.datagen.analytic_world import write_dataset
from training.prediction.predictor import Prediction

SIZE = (12, 20)
DECODING_S, PREDICTING_S, COMPILING_S = 100.0, 2.0, 1000.0


@dataclass
class Clock:
    """Time that passes only where something says so."""

    now: float = 0.0

    def after(self, seconds: float, answer: Any) -> Callable[[], Any]:
        def wait() -> Any:
            self.now += seconds
            return answer

        return wait


@dataclass
class Constant:
    """Predicts 5 px, after compiling at its first frame."""

    clock: Clock
    compiled: bool = False

    def predict(self, left: Image, right: Image) -> Prediction:  # noqa: ARG002
        self.clock.now += PREDICTING_S if self.compiled else COMPILING_S
        self.compiled = True
        return Prediction(np.full(left.shape[:2], 5, np.float32), None, None)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(
        "stereoforge.pipelines.prediction.time", SimpleNamespace(perf_counter=lambda: clock.now)
    )
    return clock


def slow_frame(clock: Clock, name: str) -> FileFrame:
    """A frame whose every array takes its time to be read."""
    image, truth = np.zeros((*SIZE, 3), np.uint8), np.full(SIZE, 6, np.float32)
    reads = [clock.after(DECODING_S, array) for array in (image, image, truth)]
    return FileFrame(name, name, *reads)


def predictors(clock: Clock, compiled: bool) -> Predictors:
    initial: Any = Constant(clock, compiled)
    fine_tuned: Any = Constant(clock, compiled)
    return Predictors(initial, fine_tuned)


def test_reading_the_pictures_is_not_the_networks_time(clock: Clock) -> None:
    frame = predictors(clock, compiled=True).frame(slow_frame(clock, "a"))
    assert clock.now == 3 * DECODING_S + 2 * PREDICTING_S
    assert frame.seconds == {"disparity": PREDICTING_S, "fine_tuned": PREDICTING_S}


def test_compiling_at_the_first_frame_is_not_the_networks_time(clock: Clock) -> None:
    data = TestData("set", FileFrames([slow_frame(clock, "a"), slow_frame(clock, "b")]), "", "test")
    scores = evaluate_set(
        data, predictors(clock, compiled=False), (Regressor(), RegressorF())
    ).evaluation.scores
    assert scores["regressor"].seconds == pytest.approx(PREDICTING_S, abs=1.0)
    assert scores["regressor_f"].seconds == pytest.approx(PREDICTING_S, abs=1.0)
    assert len(scores) == 2


def test_exports_have_the_scenes_of_the_set_they_were_made_from(tmp_path: Path, clock: Clock) -> None:
    """As many as intervals are drawn from: two frames of each of five scenes, however they are stored."""
    write_dataset(tmp_path / "set", {"train": 5})
    sets = [StereoDataset(tmp_path / "set", "train")]
    scenes = [f"TRAIN/A/{number // 2:04d}" for number in range(10)]
    assert [frame.scene_name for frame in sets[0]] == scenes
    for name in ("webdataset", "kitti", "sceneflow"):
        EXPORTERS[name](sets, open_tree(tmp_path / name), ExportOptions(), lambda *_: None)
        (data,) = open_test_data([str(tmp_path / name)], "train")
        frames = [predictors(clock, compiled=True).frame(frame) for frame in data.frames]
        assert len(frames) == 10
        pairs = [(frame.scene, scene) for frame, scene in zip(frames, scenes, strict=True)]
        assert len(set(pairs)) == len({scene for scene, _ in pairs}) == 5


def test_sets_that_number_every_object_have_no_foreground_for_kitti_s_table(
    tmp_path: Path, clock: Clock
) -> None:
    """Our own sets, in folders and in shards; their KITTI exports have one, with no vehicle in it here."""
    write_dataset(tmp_path / "set", {"test": 2})
    sets = [StereoDataset(tmp_path / "set", "test")]
    for name in ("webdataset", "kitti"):
        EXPORTERS[name](sets, open_tree(tmp_path / name), ExportOptions(), lambda *_: None)
    shutil.copytree(tmp_path / "kitti/testing", tmp_path / "kitti/training")
    for name in ("set", "webdataset", "kitti"):
        (data,) = open_test_data([str(tmp_path / name)], "test")
        # The analytic world's recipe and its scenes name different families.
        assert data.family == {"set": "flying_things", "webdataset": "analytic", "kitti": "kitti2015"}[name]
        assert (data.frames[0].object_index_left is None) == (name == "kitti")
        evaluated = evaluate_set(data, predictors(clock, compiled=True), (Regressor(), RegressorF()))
        assert evaluated.is_kitti == (name == "kitti")
        assert (6 in [table.number for table in paper_tables(evaluated)]) == (name == "kitti")
        score = evaluated.evaluation.scores["regressor"].d1
        assert np.isfinite(score.background)
        assert np.isnan(score.foreground)

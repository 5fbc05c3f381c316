"""`render --camera`: a set as somebody's rig sees it, from the file to every reader of the set."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from datagen import DatasetError, Recipe, StereoDataset, read_recipe
from datagen.cameras.registry import read_calibration
from datagen.recipe.curation import Curation
from datagen.sources.registry import open_source
from datagen.verify.dataset_check import verify_dataset
from scenes import FAMILIES, Scene, sample_scene
from scenes.family import Family
from scenes.spec import Rig, StereoCamera, Trajectory
from stereoforge.cli import main

CALIB = """cam0=[110 0 62; 0 110 41; 0 0 1]
cam1=[110 0 71.5; 0 110 41; 0 0 1]
doffs=9.5
baseline=400
width=128
height=80
"""
"""Points farther than 110 * 0.4 / 9.5 = 4.6 m have a negative disparity, the sky -9.5 px."""


def run(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


@pytest.fixture(scope="module")
def calib(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rig") / "calib.txt"
    path.write_text(CALIB)
    return path


@pytest.fixture(scope="module")
def own_set(calib: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("own") / "set"
    assert run("render", "--camera", calib, "--scenes", 2, "--samples", 1, "--workers", 1, "--out", out) == 0
    return out


def test_the_set_is_whole_and_has_the_rig(own_set: Path) -> None:
    assert verify_dataset(own_set).problems == ()
    rig = read_recipe(own_set / "recipe.yaml").world.rig
    assert rig == Rig(128, 80, 110, 110, 62.5, 72.0, 41.5, 0.4)
    for sample in StereoDataset(own_set, "train"):
        assert sample.size == (80, 128)
        sky = sample.object_index_left == 0
        assert sky.any()
        np.testing.assert_array_equal(sample.disparity_left[sky], np.float32(-9.5))
        assert (sample.disparity_left[~sky] > -9.5).all()
        assert (sample.disparity_left < 0)[~sky].any()


def test_depths_are_middleburys(own_set: Path) -> None:
    """Z = baseline f / (d + doffs), against the scene's own vertices: none lies nearer or farther in the view."""
    from datagen.ground_truth.scene_geometry import build_geometry

    sample = StereoDataset(own_set, "train")[0]
    scene = sample.scene_record
    seen = sample.object_index_left > 0
    depth = 0.4 * 110 / (sample.disparity_left[seen].astype(np.float64) + 9.5)
    to_left = np.linalg.inv(scene.camera.pose("left", 0.0))
    away = -build_geometry(scene).vertices(0.0, to_left)[:, 2]
    assert away[away > 0].min() <= depth.min()
    assert depth.max() <= away.max()


def test_shards_keep_negative_disparities(own_set: Path, tmp_path: Path) -> None:
    assert run("export", own_set, "--format", "webdataset", "--out", tmp_path / "shards") == 0
    shards, native = (open_source(str(place)).frames("train") for place in (tmp_path / "shards", own_set))
    for one, two in zip(shards, native, strict=True):
        np.testing.assert_array_equal(one.disparity_left, two.disparity_left)
        np.testing.assert_array_equal(one.disparity_right, two.disparity_right)
        assert not one.impossible_left


def test_kitti_gets_the_calibration_and_no_negative_disparity(
    own_set: Path, calib: Path, tmp_path: Path
) -> None:
    assert run("export", own_set, "--format", "kitti", "--out", tmp_path) == 0
    found = read_calibration(tmp_path / "training/calib_cam_to_cam/000000.txt")
    assert found.rig() == read_calibration(calib).rig()
    frame = open_source(str(tmp_path)).frames("train")[0]
    original = StereoDataset(own_set, "train")[0].disparity_left
    np.testing.assert_array_equal(np.isnan(frame.disparity_left), original <= 0)


def test_another_size_scales_the_rig(calib: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "half"
    flags = ("--camera", calib, "--scenes", "1", "--samples", "1", "--workers", "1", "--out", out)
    assert run("render", *flags, "--size", "64x40") == 0
    assert "scaled from 128x80 to 64x40" in " ".join(capsys.readouterr().out.split())
    assert read_recipe(out / "recipe.yaml").world.rig == Rig(64, 40, 55, 55, 31.25, 36.0, 20.75, 0.4)
    np.testing.assert_allclose(StereoDataset(out, "train")[0].disparity_left.min(), -4.75)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--size", "64x64"), "images of 64x64 have another shape than the camera's 128x80"),
        (("--disparity-range", "5,50"), "a rig of its own or asks for disparities, not both"),
        (("--disparity-histogram", "2-20:30,20-60:50"), "a rig of its own or asks for disparities, not both"),
    ],
)
def test_what_does_not_go_together(
    flags: tuple[str, ...], message: str, calib: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("render", "--camera", calib, "--out", tmp_path / "set", *flags) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "set").exists()


def test_a_file_that_is_no_calibration_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "rig.json"
    path.write_text(json.dumps({"width": 128}))
    assert run("render", "--camera", path, "--out", tmp_path / "set") == 1
    said = capsys.readouterr().err
    assert "it needs the number 'fx'" in " ".join(said.split())
    assert "Traceback" not in said


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_every_family_takes_a_rig(family: str) -> None:
    rig = Rig(96, 64, 90, 95, 50, 56, 30, 0.3)
    config = FAMILIES[family].config(width=96, height=64, rig=rig)
    camera = sample_scene(np.random.default_rng(3), family, config).camera
    assert camera == rig.camera(camera.motion)
    assert (camera.focal_px, camera.focal_y_px) == (pytest.approx(90), pytest.approx(95))
    assert (camera.principal_point("left"), camera.principal_point("right")) == ((50, 30), (56, 30))


def test_a_family_that_ignores_the_rig_is_not_taken_for_one_that_has_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flying = FAMILIES["flying_things"]

    def with_a_lens_of_its_own(rng: np.random.Generator, config: object) -> Scene:
        scene = flying.sample(rng, config)
        camera = StereoCamera(96, 64, 35.0, 0.2, Trajectory.static())
        return Scene(scene.family, 1, camera, scene.objects, scene.materials, scene.lights, scene.world)

    monkeypatch.setitem(
        FAMILIES, "flying_things", Family("flying_things", flying.config, with_a_lens_of_its_own)
    )
    config = flying.config(width=96, height=64, rig=Rig(96, 64, 90, 90, 48, 48, 32, 0.3))
    with pytest.raises(ValueError, match="flying_things takes no rig of one's own"):
        sample_scene(np.random.default_rng(0), "flying_things", config)


def test_sizes_of_rig_and_config_agree() -> None:
    rig = Rig(96, 64, 90, 90, 48, 48, 32, 0.3)
    with pytest.raises(ValueError, match="the rig's images are 96x64, not 960x540"):
        FAMILIES["driving"].config(rig=rig)
    with pytest.raises(DatasetError, match="not both"):
        Recipe(
            FAMILIES["driving"].config(width=96, height=64, rig=rig),
            {"train": 1},
            curation=Curation(disparity_px=(0.0, 20.0)),
        )

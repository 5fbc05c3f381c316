"""What the page shows, without the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import stereoforge.app.results as results
from datagen.formats import read_pfm, write_png
from datagen.formats.disparity.registry import read_disparity_map
from stereoforge import StereoRefiner
from stereoforge.app.examples import examples
from stereoforge.app.model import write_model
from stereoforge.app.results import Found, ReadPair
from stereoforge.errors import CommandError
from tests.stereoforge.test_refine_many import SHIFT_PX, picture_pair


@pytest.fixture(scope="module")
def refiner() -> StereoRefiner:
    return StereoRefiner()


@pytest.fixture(scope="module")
def found(refiner: StereoRefiner) -> Found:
    return results.find(refiner, ReadPair(*picture_pair(1), remarks=()), 1.0)


def test_another_strength_does_what_a_call_with_scaled_weights_would(
    refiner: StereoRefiner, found: Found
) -> None:
    """At nearly no strength the initial disparity stays; the networks are not asked again."""
    assert results.find_again(refiner, found, 1.0) is found
    weak = results.find_again(refiner, found, 1e-9)
    assert weak.prediction is found.prediction
    change, usual = (np.abs(each.refined.disparity - each.refined.initial).mean() for each in (weak, found))
    assert change < usual / 10
    whole = refiner(found.pair.left, found.pair.right)
    np.testing.assert_array_equal(found.refined.disparity, whole.disparity)


def test_values_of_a_pixel(found: Found) -> None:
    calibration, _ = results.calibration_of(results.rig_of(None, 500.0, 0.1, None), found.pair)
    said = results.value_at(found.refined, calibration, 60, 30)
    disparity = found.refined.disparity[30, 60]
    assert said.startswith(f"x 60, y 30: disparity {disparity:.2f} px")
    assert said.endswith(f"depth {50 / disparity:.3f} m")
    assert "depth" not in results.value_at(found.refined, None, 60, 30)
    assert results.value_at(found.refined, None, 128, 0) == ""


def test_files(found: Found, tmp_path: Path) -> None:
    calibration, _ = results.calibration_of(results.rig_of(None, 500.0, 0.1, None), found.pair)
    assert calibration is not None
    points, colors, said = results.point_cloud(found, calibration, 0.2)
    assert said.startswith("points.ply: ")
    assert abs(np.median(points[:, 2]) - 50 / SHIFT_PX) < 1
    files, remarks = results.write_files(tmp_path / "with", found, (points, colors))
    assert [file.name for file in files] == list(results.FILE_CONTENTS)
    assert remarks == []
    np.testing.assert_array_equal(read_pfm(files[0]), found.refined.disparity)
    np.testing.assert_allclose(read_disparity_map(files[1]), found.refined.disparity, atol=1 / 256)
    assert len(trimesh.load(files[4]).vertices) == len(points)
    files, _ = results.write_files(tmp_path / "without", found, None)
    assert [file.name for file in files] == list(results.FILE_CONTENTS)[:-1]
    write_model(tmp_path / "points.glb", points, colors)
    (cloud,) = trimesh.load(tmp_path / "points.glb").geometry.values()
    assert cloud.vertices[:, 2].max() < 0


def test_what_lies_apart_is_not_shown(tmp_path: Path) -> None:
    """The viewer looks at the middle of all it is given."""
    room = np.random.default_rng(0).uniform((-1, -1, 4), (1, 1, 6), (5000, 3))
    apart = np.array([(-9.0, 0, 5), (0, -4, 5), (0, 0, 1.5), (0, 0, 90)])
    write_model(tmp_path / "points.glb", np.vstack([apart, room]), np.zeros((5004, 3), np.uint8))
    (cloud,) = trimesh.load(tmp_path / "points.glb").geometry.values()
    np.testing.assert_allclose(np.unique(cloud.vertices), np.unique((room * (1, -1, -1)).astype(np.float32)))


@pytest.mark.parametrize(
    ("numbers", "sentence"),
    [
        ((500.0, None, None), "needs both the focal length and the baseline"),
        ((500.0, -1.0, None), "must be positive"),
    ],
)
def test_half_a_rig(numbers: tuple[float | None, ...], sentence: str) -> None:
    with pytest.raises(CommandError, match=sentence):
        results.rig_of(None, *numbers)


def test_pictures_that_cannot_be_a_pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left, right = picture_pair(1)
    write_png(tmp_path / "left.png", left)
    write_png(tmp_path / "right.png", right)
    write_png(tmp_path / "small.png", right[:, :-8])
    with pytest.raises(CommandError, match=r"differ in size: the left one has 128x64 pixels, .* 120x64"):
        results.read_pair(tmp_path / "left.png", tmp_path / "small.png")
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(CommandError, match=r"^text\.png: "):
        results.read_pair(tmp_path / "left.png", tmp_path / "text.png")
    (tmp_path / "calib.txt").write_text("no calibration")
    with pytest.raises(CommandError, match=r"^calib\.txt: "):
        results.rig_of(tmp_path / "calib.txt", None, None, None)
    with pytest.raises(CommandError, match="the right picture is missing"):
        results.read_pair(tmp_path / "left.png", None)
    monkeypatch.setattr(results, "MOST_PIXELS", 8000)
    with pytest.raises(CommandError, match=r"128x64 pixels, more than the 0\.008 million"):
        results.read_pair(tmp_path / "left.png", tmp_path / "right.png")


def test_examples_are_small_and_have_calibrations() -> None:
    size = 0
    for example in examples():
        pair = results.read_pair(example.left, example.right)
        calibration, remarks = results.calibration_of(
            results.rig_of(example.calibration, None, None, None), pair
        )
        assert calibration is not None
        assert [*remarks, *pair.remarks] == []
        size += sum(path.stat().st_size for path in (example.left, example.right))
    assert 0 < size <= 300_000

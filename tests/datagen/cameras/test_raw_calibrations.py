"""Raw calibrations: numbers of the formats' own examples, and what OpenCV makes of the same numbers."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from datagen.cameras.raw_calibration import RawCalibration
from datagen.cameras.rectification import plan_rectification
from datagen.cameras.registry import read_calibration, read_raw_calibration, write_calibration
from datagen.errors import FormatError

KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 0.8, -0.6, 0.001]
  - [0.0, 0.6, 0.8, -0.002]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.27, 0.06, 0.0001, -0.00003]
  distortion_model: radtan
  intrinsics: [457.6, 456.1, 379.9, 255.2]
  resolution: [752, 480]
"""
ZED = """[LEFT_CAM_HD]
fx=700.1
fy=700.2
cx=640.3
cy=360.9
k1=-0.17
k2=0.02
p1=0.0001 ; tangential
p2=-0.0002
k3=0.001

[RIGHT_CAM_HD]
fx=699.8
fy=699.7
cx=655.1
cy=362.7
k1=-0.171
k2=0.021

[LEFT_CAM_VGA]
fx=350
fy=350
cx=336
cy=188
k1=-0.17
k2=0.02

[RIGHT_CAM_VGA]
fx=350
fy=350
cx=336
cy=188
k1=-0.17
k2=0.02

[STEREO]
Baseline=120.02
TY=0.31
TZ=-0.42
CV_HD=0.004
CV_VGA=0.005
RX_HD=-0.002
RX_VGA=0
RZ_HD=0.0015
RZ_VGA=0
"""
K1 = np.array([[700.0, 0, 330], [0, 702, 250], [0, 0, 1]])
K2 = np.array([[705.0, 0, 322], [0, 707, 246], [0, 0, 1]])
D1, D2 = np.array([-0.1, 0.05, 0.001, -0.001, 0]), np.array([-0.12, 0.04, -0.001, 0.002, 0])
TURN = cv2.Rodrigues(np.array([0.01, -0.03, 0.02]))[0]
SHIFT = np.array([-0.15, 0.002, -0.004])
SIZE = (640, 480)


def stored(path: Path, **values: np.ndarray | float | str) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        storage.write(name, value)
    storage.release()
    return path


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def assert_is_the_rig(found: RawCalibration) -> None:
    np.testing.assert_allclose(found.left.matrix, K1)
    np.testing.assert_allclose(found.right.matrix, K2)
    np.testing.assert_allclose(found.left.distortion, D1)
    np.testing.assert_allclose(found.right.distortion, D2)
    np.testing.assert_allclose(found.rotation, TURN, atol=1e-12)
    np.testing.assert_allclose(found.translation_m, SHIFT, atol=1e-12)
    assert found.size == SIZE


@pytest.mark.parametrize(
    "names", ["K1 D1 K2 D2", "M1 D1 M2 D2", "cameraMatrix1 distCoeffs1 cameraMatrix2 distCoeffs2"]
)
def test_opencv_names_units_and_sizes(tmp_path: Path, names: str) -> None:
    values = dict(zip(names.split(), (K1, D1, K2, D2), strict=True))
    path = stored(tmp_path / "a.yml", **values, R=TURN, T=1000 * SHIFT, unit="mm")
    assert_is_the_rig(read_raw_calibration(path, SIZE))
    with pytest.raises(FormatError, match="no image_width"):
        read_raw_calibration(path)
    path = stored(tmp_path / "b.yml", **values, R=TURN, T=SHIFT, image_width=640, image_height=480)
    assert_is_the_rig(read_raw_calibration(path))
    # What is read for rectified pictures is what rectify makes by default.
    assert plan_rectification(read_raw_calibration(path)).calibration == read_calibration(path)
    with pytest.raises(FormatError, match="is of pictures of 640x480, but these are 320x240"):
        read_raw_calibration(path, (320, 240))


def test_the_two_files_of_opencvs_sample(tmp_path: Path) -> None:
    """samples/cpp/stereo_calib.cpp: its own rectification is taken, and alpha makes another."""
    r1, r2, p1, p2, *_ = cv2.stereoRectify(K1, D1, K2, D2, SIZE, TURN, SHIFT, flags=0, alpha=1)
    one = stored(tmp_path / "intrinsics.yml", M1=K1, D1=D1, M2=K2, D2=D2)
    other = stored(tmp_path / "extrinsics.yml", R=TURN, T=SHIFT, R1=r1, R2=r2, P1=p1, P2=p2)
    raw = read_raw_calibration(f"{one},{other}", SIZE)
    assert_is_the_rig(raw)
    planned = plan_rectification(raw)
    np.testing.assert_allclose(planned.projections, (p1, p2))
    np.testing.assert_allclose(planned.rotations, (r1, r2))
    calibration = planned.calibration
    assert (calibration.cx_left, calibration.cx_right) == (p1[0, 2], p2[0, 2])
    assert calibration.doffs != 0
    assert plan_rectification(raw, 1.0).calibration.doffs == 0
    swapped = stored(tmp_path / "swapped.yml", R=TURN, T=SHIFT, R1=r2, R2=r1, P1=p1, P2=p2)
    with pytest.raises(FormatError, match="R1 and R2 do not belong to its R"):
        read_raw_calibration(f"{one},{swapped}", SIZE)


@pytest.mark.parametrize("stated", [{"distortion_model": "fisheye"}, {"fisheye_model": 1}])
def test_a_fisheye_is_one_where_the_file_says_so(tmp_path: Path, stated: dict[str, str | int]) -> None:
    lens = np.array([[-0.01], [0.003], [-0.002], [0.0005]])
    path = stored(tmp_path / "a.yml", K=K1, D=lens, R=TURN, T=SHIFT, width=640, height=480, **stated)
    found = read_raw_calibration(path)
    assert (found.left.model, found.right.model) == ("fisheye", "fisheye")
    np.testing.assert_array_equal(found.left.distortion, lens[:, 0])
    _, _, p1, _, _ = cv2.fisheye.stereoRectify(
        K1, lens, K1, lens, SIZE, TURN, SHIFT, cv2.fisheye.CALIB_ZERO_DISPARITY
    )
    assert plan_rectification(found).calibration.fx == pytest.approx(p1[0, 0])
    path = stored(tmp_path / "b.yml", K=K1, D=lens, R=TURN, T=SHIFT, width=640, height=480)
    assert read_raw_calibration(path).left.model == "brown"


def test_kalibr(tmp_path: Path) -> None:
    found = read_raw_calibration(written(tmp_path / "camchain.yaml", KALIBR), (752, 480))
    np.testing.assert_array_equal(found.right.matrix, [[457.6, 0, 379.9], [0, 456.1, 255.2], [0, 0, 1]])
    np.testing.assert_array_equal(found.left.distortion, [-0.28, 0.07, 0.0002, 0.00002])
    np.testing.assert_array_equal(found.rotation, [[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    np.testing.assert_array_equal(found.translation_m, [-0.11, 0.001, -0.002])
    fish = written(tmp_path / "fish.yaml", KALIBR.replace("radtan", "equidistant"))
    assert read_raw_calibration(fish).left.model == "fisheye"
    bare = KALIBR.replace("radtan", "none").replace("-0.6", "0.0").replace("0.6", "0.0").replace("0.8", "1.0")
    bare = written(tmp_path / "bare.yaml", bare)
    assert not read_raw_calibration(bare).left.distortion.any()
    assert read_calibration(bare).baseline_m == pytest.approx(np.linalg.norm([0.11, 0.001, 0.002]))


def test_zed_as_stereolabs_reads_it(tmp_path: Path) -> None:
    """Their programs give OpenCV Baseline, TY and TZ as T, whose sign stereoRectify's rotations do not depend on."""
    path = written(tmp_path / "SN1234.conf", ZED)
    found = read_raw_calibration(path, (1280, 720))
    left, right = found.left.matrix, found.right.matrix
    np.testing.assert_array_equal(left, [[700.1, 0, 640.3], [0, 700.2, 360.9], [0, 0, 1]])
    np.testing.assert_array_equal(found.left.distortion, [-0.17, 0.02, 0.0001, -0.0002, 0.001])
    np.testing.assert_array_equal(found.right.distortion, [-0.171, 0.021, 0, 0, 0])
    turn, _ = cv2.Rodrigues(np.array([-0.002, 0.004, 0.0015]))
    r1, r2, p1, *_ = cv2.stereoRectify(
        left, found.left.distortion, right, found.right.distortion, (1280, 720), turn,
        np.array([120.02, 0.31, -0.42]), alpha=0,
    )  # fmt: skip
    planned = plan_rectification(found, 0.0)
    np.testing.assert_allclose(planned.rotations, (r1, r2), atol=1e-12)
    assert planned.calibration.fx == pytest.approx(p1[0, 0])
    assert planned.calibration.baseline_m == pytest.approx(np.linalg.norm([0.12002, 0.00031, 0.00042]))
    assert read_raw_calibration(path, (672, 376)).left.matrix[0, 0] == 350
    assert read_calibration(path).size == (1280, 720)
    with pytest.raises(FormatError, match="is of pictures of 1280x720, 672x376, but these are 1920x1080"):
        read_raw_calibration(path, (1920, 1080))


def test_ros_holds_the_rectification_itself(tmp_path: Path) -> None:
    r1, r2, p1, p2, *_ = cv2.stereoRectify(K1, D1, K2, D2, SIZE, TURN, SHIFT, alpha=0)
    paths = []
    for name, k, d, r, p in (("l", K1, D1, r1, p1), ("r", K2, D2, r2, p2)):
        lines = [f"{key}: {{data: {value.ravel().tolist()}}}" for key, value in (
            ("camera_matrix", k), ("distortion_coefficients", d), ("rectification_matrix", r), ("projection_matrix", p),
        )]  # fmt: skip
        text = "\n".join(["image_width: 640", "image_height: 480", "distortion_model: plumb_bob", *lines])
        paths.append(str(written(tmp_path / f"{name}.yaml", text)))
    raw = read_raw_calibration(",".join(paths))
    assert_is_the_rig(raw)
    assert plan_rectification(raw).calibration == read_calibration(",".join(paths))
    flat = written(
        tmp_path / "flat.yaml", Path(paths[0]).read_text().replace("rectification_matrix", "other")
    )
    with pytest.raises(FormatError, match="the left file has no rectification_matrix"):
        read_raw_calibration(f"{flat},{paths[1]}")


def test_what_rectify_writes_is_read(tmp_path: Path) -> None:
    calibration = plan_rectification(read_raw_calibration(written(tmp_path / "a.conf", ZED))).calibration
    write_calibration(tmp_path / "rig.json", calibration)
    assert read_calibration(tmp_path / "rig.json") == calibration
    with pytest.raises(FormatError, match="describes rectified pairs"):
        read_raw_calibration(tmp_path / "rig.json")


WRONG = [
    (KALIBR.replace("pinhole", "omni"), "camera model omni; only pinhole"),
    (KALIBR.replace("radtan", "fov"), "lens model fov is none of"),
    (KALIBR.replace("cam1:", "cam7:"), "it has no cam1"),
    (KALIBR.replace("T_cn_cnm1", "T_cam_imu"), "its cam1 has no T_cn_cnm1"),
    (KALIBR.replace("[458.6, 457.3, 367.2, 248.4]", "[458.6]"), "intrinsics that are not 4 numbers"),
    (KALIBR.replace("0.8, -0.6", "0.9, -0.6"), "its R is no rotation"),
    (KALIBR.replace("-0.28,", ".nan,"), "not finite"),
    (KALIBR.replace("[458.6,", "[wide,"), "its intrinsics is no 3x3 matrix"),
    (KALIBR + "  a: [", "it is no YAML"),
    (ZED.replace("fx=700.1\n", ""), r"its \[LEFT_CAM_HD\] has no fx"),
    (ZED.replace("fx=700.1", "fx=wide"), "could not convert"),
    (ZED.replace("Baseline=120.02", "Baseline=nan"), "not finite"),
    (ZED.replace("Baseline=120.02", "Baseline=0").replace("TY=0.31", "").replace("TZ=-0.42", ""), "baseline is 0"),
    (ZED.replace("RX_HD=-0.002", "RX_HD=nan"), "not finite"),
    (ZED.replace("k1=-0.17\n", "k1=-17\n", 1), "folds|other lens"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), WRONG)
def test_wrong_files_are_one_sentence(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path / "rig", text)
    with pytest.raises(FormatError, match=message) as error:
        read_calibration(path)
    assert str(error.value).startswith(str(path))
    assert len(str(error.value)) <= 300

"""Calibrations: numbers worked out by hand, written by OpenCV, and as the formats' own pages print them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from datagen.cameras.calibration import Calibration
from datagen.cameras.registry import read_calibration
from datagen.errors import FormatError
from scenes.spec import Trajectory

# vision.middlebury.edu/stereo/data/scenes2014: Adirondack-perfect's calib.txt.
MIDDLEBURY = """cam0=[4161.221 0 1445.577; 0 4161.221 984.686; 0 0 1]
cam1=[4161.221 0 1654.636; 0 4161.221 984.686; 0 0 1]
doffs=209.059
baseline=176.252
width=2880
height=1988
ndisp=280
isint=0
vmin=33
vmax=257
"""
# The rectified colour cameras of KITTI's drive 2011_09_26.
KITTI_RAW = """calib_time: 09-Jan-2012 13:57:47
S_rect_02: 1.242000e+03 3.750000e+02
P_rect_02: 7.215377e+02 0.000000e+00 6.095593e+02 4.485728e+01 0.000000e+00 7.215377e+02 1.728540e+02 2.163791e-01 0.000000e+00 0.000000e+00 1.000000e+00 2.745884e-03
S_rect_03: 1.242000e+03 3.750000e+02
P_rect_03: 7.215377e+02 0.000000e+00 6.095593e+02 -3.395242e+02 0.000000e+00 7.215377e+02 1.728540e+02 2.199936e+00 0.000000e+00 0.000000e+00 1.000000e+00 2.729905e-03
"""  # noqa: E501
ROS = """image_width: 640
image_height: 480
camera_name: stereo/{name}
camera_matrix:
  rows: 3
  cols: 3
  data: [430.2, 0.0, 306.1, 0.0, 430.9, 227.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
projection_matrix:
  rows: 3
  cols: 4
  data: [423.6, 0.0, {cx}, {shift}, 0.0, 425.1, 239.25, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
OURS = {
    "width": 640, "height": 400, "fx": 500.0, "fy": 480.0, "cx_left": 330.5, "cx_right": 318.25, "cy": 190.0,
    "baseline_m": 0.12,
}  # fmt: skip


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_middlebury(tmp_path: Path) -> None:
    found = read_calibration(written(tmp_path, "calib.txt", MIDDLEBURY))
    assert found == Calibration(
        4161.221, 4161.221, 1445.577, 1654.636, 984.686, pytest.approx(0.176252), (2880, 1988)
    )
    assert found.doffs == pytest.approx(209.059)


def test_kitti_raw(tmp_path: Path) -> None:
    found = read_calibration(written(tmp_path, "calib_cam_to_cam.txt", KITTI_RAW))
    # The cameras' offsets from camera 0, 0.06217 and -0.47056 m, are 0.53273 m apart.
    assert found.baseline_m == pytest.approx(0.06217 + 0.47056, abs=2e-5)
    assert (found.fx, found.cx_left, found.cy, found.size) == (721.5377, 609.5593, 172.854, (1242, 375))
    assert found.doffs == 0


def test_kitti_odometry_does_not_say_its_size(tmp_path: Path) -> None:
    text = "".join(
        line.replace("P_rect_0", "P") + "\n" for line in KITTI_RAW.splitlines() if line.startswith("P_rect")
    )
    found = read_calibration(written(tmp_path, "calib.txt", text))
    assert found.size is None
    assert found.rig((1242, 375)).cx_left == pytest.approx(610.0593)
    with pytest.raises(ValueError, match="does not say how large the images are, so --size has to"):
        found.rig()


def test_ros_pair(tmp_path: Path) -> None:
    left = written(tmp_path, "left.yaml", ROS.format(name="left", cx=318.75, shift=0.0))
    right = written(tmp_path, "right.yaml", ROS.format(name="right", cx=310.5, shift=-50.832))
    found = read_calibration(f"{left},{right}")
    assert found == Calibration(423.6, 425.1, 318.75, 310.5, 239.25, pytest.approx(0.12), (640, 480))
    message = written(
        tmp_path,
        "message.yaml",
        "height: 480\nwidth: 640\nP: [423.6, 0, 318.75, 0, 0, 425.1, 239.25, 0, 0, 0, 1, 0]\n---\n",
    )
    assert read_calibration(f"{message},{right}") == found


def rotated_pair() -> tuple[np.ndarray, ...]:
    """K1, D1, K2, D2, R, T of a pair that is not rectified."""
    k1 = np.array([[700.0, 0, 330], [0, 702, 250], [0, 0, 1]])
    k2 = np.array([[705.0, 0, 322], [0, 707, 246], [0, 0, 1]])
    d1, d2 = np.array([-0.1, 0.05, 0.001, -0.001, 0]), np.array([-0.12, 0.04, -0.001, 0.002, 0])
    turn, _ = cv2.Rodrigues(np.array([0.01, -0.03, 0.02]))
    return k1, d1, k2, d2, turn, np.array([[-0.15], [0.002], [-0.004]])


def store(path: Path, **values: np.ndarray | float | str) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        storage.write(name, value)
    storage.release()
    return path


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_opencv_projections(tmp_path: Path, unit: str) -> None:
    k1, d1, k2, d2, turn, shift = rotated_pair()
    scale = 1.0 if unit == "m" else 1000.0
    _, _, p1, p2, *_ = cv2.stereoRectify(k1, d1, k2, d2, (640, 480), turn, shift * scale, flags=0, alpha=0)
    path = store(tmp_path / "a.yml", P1=p1, P2=p2, unit=unit, image_width=640, image_height=480)
    found = read_calibration(path)
    assert found.fx == p1[0, 0]
    assert found.fy == p1[1, 1]
    assert found.cy == p1[1, 2]
    assert (found.cx_left, found.cx_right) == (p1[0, 2], p2[0, 2])
    assert found.doffs != 0  # without CALIB_ZERO_DISPARITY
    # Rectification turns the cameras about their centres: their distance stays.
    assert found.baseline_m == pytest.approx(np.linalg.norm(shift), rel=1e-9)
    assert found.size == (640, 480)


def test_opencv_calibration_is_rectified_as_opencv_does_it(tmp_path: Path) -> None:
    k1, d1, k2, d2, turn, shift = rotated_pair()
    path = store(
        tmp_path / "a.yaml", M1=k1, D1=d1, M2=k2, D2=d2, R=turn, T=shift, image_width=640, image_height=480
    )
    _, _, p1, p2, *_ = cv2.stereoRectify(k1, d1, k2, d2, (640, 480), turn, shift)
    found = read_calibration(path)
    assert (found.fx, found.cx_left, found.cx_right, found.cy) == (p1[0, 0], p1[0, 2], p2[0, 2], p1[1, 2])


def test_opencv_parallel_cameras_are_taken_as_they_are(tmp_path: Path) -> None:
    """K, R and T after rectification: nothing is rectified a second time."""
    k1 = np.array([[700.0, 0, 330], [0, 690, 250], [0, 0, 1]])
    k2 = k1 + np.array([[0, 0, -12.5], [0, 0, 0], [0, 0, 0]])
    path = store(tmp_path / "a.yaml", K1=k1, K2=k2, R=np.eye(3), T=np.array([[-0.2], [0], [0]]))
    assert read_calibration(path) == Calibration(700, 690, 330, 317.5, 250, 0.2, None)
    path = store(tmp_path / "b.yaml", K=k1, R=np.eye(3), T=np.array([-0.2, 0, 0]), width=640, height=480)
    assert read_calibration(path) == Calibration(700, 690, 330, 330, 250, 0.2, (640, 480))


def test_ours(tmp_path: Path) -> None:
    found = read_calibration(written(tmp_path, "rig.json", json.dumps(OURS | {"frames": {}})))
    assert found == Calibration(500.0, 480.0, 330.5, 318.25, 190.0, 0.12, (640, 400))


def test_a_rig_projects_as_the_calibration_does(tmp_path: Path) -> None:
    """A point's pixel by OpenCV's formula, where the first pixel's centre is 0; in the camera it is 0.5."""
    found = read_calibration(written(tmp_path, "rig.json", json.dumps(OURS)))
    camera = found.rig().camera(Trajectory.static())
    x, y, z = 0.4, -0.3, 2.5
    opencv_left = np.array([found.fx * x / z + found.cx_left, found.fy * y / z + found.cy])
    opencv_right = np.array(
        [found.fx * (x - found.baseline_m) / z + found.cx_right, found.fy * y / z + found.cy]
    )
    for view, expected, shift in (("left", opencv_left, 0.0), ("right", opencv_right, found.baseline_m)):
        center = camera.principal_point(view)
        seen = [center[0] + camera.focal_px * (x - shift) / z, center[1] + camera.focal_y_px * y / z]
        np.testing.assert_allclose(seen, expected + 0.5, rtol=1e-12)
    disparity = opencv_left[0] - opencv_right[0]
    # Middlebury: Z = baseline * f / (d + doffs).
    assert found.baseline_m * found.fx / (disparity + found.doffs) == pytest.approx(z)
    assert camera.disparity_metres / z + camera.disparity_at_infinity == pytest.approx(disparity)
    assert camera.disparity_at_infinity == pytest.approx(-found.doffs)


def test_a_rig_of_another_size_sees_the_same(tmp_path: Path) -> None:
    """Half the size: the left border, the middle and the right border look in the same directions."""
    found = read_calibration(written(tmp_path, "rig.json", json.dumps(OURS)))
    whole, half = found.rig(), found.rig((320, 200))
    for share in (0.0, 0.5, 1.0):
        for center in ("cx_left", "cx_right"):
            assert (share * 320 - getattr(half, center)) / half.fx == pytest.approx(
                (share * 640 - getattr(whole, center)) / whole.fx
            )
        assert (share * 200 - half.cy) / half.fy == pytest.approx((share * 400 - whole.cy) / whole.fy)
    assert half.baseline_m == whole.baseline_m
    with pytest.raises(ValueError, match="320x240 have another shape than the camera's 640x400"):
        found.rig((320, 240))


def test_a_size_may_be_rounded_to_whole_pixels() -> None:
    adirondack = Calibration(4161.221, 4161.221, 1445.577, 1654.636, 984.686, 0.176252, (2880, 1988))
    assert adirondack.rig((300, 207)).height == 207  # 207.08
    with pytest.raises(ValueError, match="another shape"):
        adirondack.rig((300, 205))


BROKEN = [
    (MIDDLEBURY.replace("doffs=209.059", "doffs=0"), "its doffs 0 is not 209.059"),
    (MIDDLEBURY.replace("cam1", "cam2"), "it has no cam1="),
    (
        MIDDLEBURY.replace("cam1=[4161.221", "cam1=[4061.221"),
        "focal lengths .* differ, so they are not rectified",
    ),
    (MIDDLEBURY.replace("1654.636; 0 4161.221 984.686", "1654.636; 0 4161.221 999.686"), "cy .* differ"),
    (MIDDLEBURY.replace("baseline=176.252", "baseline=176252"), "is it in millimetres"),
    (MIDDLEBURY.replace("width=2880", "width=0"), "its size .* is none"),
    (MIDDLEBURY.replace("baseline=176.252", "baseline=wide"), "could not convert"),
    (KITTI_RAW.replace("P_rect_03", "Q_rect_03"), "it has no P_rect_03:, so only one view"),
    (KITTI_RAW.replace("-3.395242e+02", "3.395242e+02"), "are the views swapped"),
    (ROS.format(name="left", cx=318.75, shift=0.0), "give LEFT.yaml,RIGHT.yaml"),
    (json.dumps(OURS | {"fx": "wide"}), "it needs the number 'fx'"),
    (json.dumps(OURS | {"fx": float("nan")}), "not finite"),
    (json.dumps({k: v for k, v in OURS.items() if k != "cy"}), "it needs the number 'cy'"),
    ("{", "is no JSON"),
    ("%YAML:1.0\n---\nP1: [", "OpenCV cannot read it|neither P1 and P2"),
    ("%YAML:1.0\n---\na: 1\n", "it has neither P1 and P2 nor K1"),
    ("hello", "is no calibration that is known: "),
    ("", "is no calibration that is known: "),
    ("P: &a [*a]\nwidth: 1\nheight: 1\n", "give LEFT.yaml"),
]


@pytest.mark.parametrize(("text", "message"), BROKEN)
def test_broken_files_are_one_sentence(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, "calib.txt", text)
    with pytest.raises(FormatError, match=message) as error:
        read_calibration(path)
    assert str(error.value).startswith(str(path))
    assert len(str(error.value)) <= 300
    assert "\n" not in str(error.value)


def test_missing_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="cannot be read"):
        read_calibration(tmp_path / "none.txt")
    (tmp_path / "a.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FormatError, match="a calibration is text"):
        read_calibration(tmp_path / "a.yaml")


def test_ros_views_of_two_sizes(tmp_path: Path) -> None:
    left = written(tmp_path, "left.yaml", ROS.format(name="left", cx=318.75, shift=0.0))
    right = written(tmp_path, "r.yaml", ROS.format(name="r", cx=310, shift=-50).replace("640", "320"))
    with pytest.raises(FormatError, match="the views are 640x480 and 320x480"):
        read_calibration(f"{left},{right}")
    aliased = written(tmp_path, "b.yaml", "P: &a [*a]\nwidth: 1\nheight: 1\n")
    with pytest.raises(FormatError, match="the right file is no camera_info"):
        read_calibration(f"{left},{aliased}")


def test_a_rig_far_outside_its_image_is_refused() -> None:
    rig = Calibration(500, 500, 320, 320, 200, 0.1, (640, 400)).rig()
    with pytest.raises(ValueError, match="cx_left must be near its image"):
        replace(rig, cx_left=5000.0)
    with pytest.raises(ValueError, match="fy must be positive"):
        replace(rig, fy=0.0)

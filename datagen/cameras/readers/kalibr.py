"""Kalibr's `camchain.yaml` (Rehder et al., ICRA 2016): cam0 is the left camera, cam1 the right one.

cam0:
  camera_model: pinhole
  intrinsics: [458.65, 457.29, 367.21, 248.37]      fx, fy, cx, cy
  distortion_model: radtan                          k1, k2, p1, p2; or equidistant, OpenCV's fisheye
  distortion_coeffs: [-0.28, 0.074, 0.0002, 0.00002]
  resolution: [752, 480]
cam1:
  T_cn_cnm1: [[...], [...], [...], [...]]           takes points of cam0's frame to cam1's, in metres
  ...
"""

from __future__ import annotations

from typing import Any

import numpy as np

from datagen.cameras.calibration import Calibration, CalibrationText, mapping_of_yaml, matrix_of, size_of
from datagen.cameras.raw_calibration import (
    RawCalibration,
    RawView,
    agreed_size,
    camera_matrix,
    lens_model_of,
)
from datagen.cameras.reader import CalibrationReader
from datagen.cameras.rectification import plan_rectification
from stereoforge_kit.errors import InputError

_CAMERAS = ("cam0", "cam1")


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    lines = texts[0].text.splitlines()
    return len(texts) == 1 and not texts[0].is_opencv and any(line.startswith("cam0:") for line in lines)


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    return plan_rectification(_read_raw(texts, None)).calibration


def _read_raw(texts: tuple[CalibrationText, ...], size: tuple[int, int] | None) -> RawCalibration:
    data = mapping_of_yaml(texts[0].text)
    if data is None:
        raise InputError("it is no YAML")
    for name in _CAMERAS:
        if not isinstance(data.get(name), dict):
            raise InputError(f"it has no {name}, and a pair has {' and '.join(_CAMERAS)}")
    left, right = (data[name] for name in _CAMERAS)
    sizes = [
        size_of(*_list(camera, "resolution", 2, name))
        for name, camera in zip(_CAMERAS, (left, right), strict=True)
    ]
    if sizes[0] != sizes[1]:
        raise InputError("its cameras are {}x{} and {}x{}".format(*sizes[0], *sizes[1]))
    between = matrix_of(_value(right, "T_cn_cnm1", "cam1"), 4, 4, "T_cn_cnm1")
    return RawCalibration(
        _view(left, "cam0"),
        _view(right, "cam1"),
        between[:3, :3],
        between[:3, 3],
        agreed_size(sizes[0], size),
    )


def _view(camera: dict[str, Any], name: str) -> RawView:
    kind = _value(camera, "camera_model", name)
    if kind != "pinhole":
        raise InputError(f"its {name} is of the camera model {kind!s:.20}; only pinhole is read")
    model = camera.get("distortion_model", "none")
    coefficients = _value(camera, "distortion_coeffs", name) if model != "none" else np.zeros(4)
    return RawView(
        camera_matrix(*_list(camera, "intrinsics", 4, name)),
        matrix_of(coefficients, 1, -1, "distortion_coeffs")[0],
        lens_model_of("" if model == "none" else model),
    )


def _list(camera: dict[str, Any], key: str, length: int, name: str) -> list[Any]:
    found = _value(camera, key, name)
    if not isinstance(found, list) or len(found) != length:
        raise InputError(f"its {name} has {key} that are not {length} numbers")
    return found


def _value(camera: dict[str, Any], key: str, name: str) -> Any:
    if key not in camera:
        raise InputError(f"its {name} has no {key}")
    return camera[key]


READER = CalibrationReader("Kalibr's camchain.yaml", _recognises, _read, _read_raw)

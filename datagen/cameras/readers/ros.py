"""ROS: two `camera_info` files, as `camera_calibration` writes them or as messages are printed.

    image_width: 640                          width: 640
    image_height: 480                         height: 480
    projection_matrix:                        P: [423.6, 0.0, 318.7, -38.1, ...]
      data: [423.6, 0.0, 318.7, -38.1, ...]

Rectification also reads `camera_matrix`, `distortion_model`, `distortion_coefficients` and `rectification_matrix`, in
messages K, D and R. The left file first. The right projection holds -fx * baseline, in metres (REP 104).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.cameras.calibration import (
    Calibration,
    CalibrationText,
    from_projections,
    mapping_of_yaml,
    matrix_of,
    size_of,
)
from datagen.cameras.raw_calibration import (
    OwnRectification,
    RawCalibration,
    RawView,
    agreed_size,
    lens_model_of,
)
from datagen.cameras.reader import CalibrationReader
from stereoforge_kit.errors import InputError

_WIDTHS, _HEIGHTS = ("image_width", "width"), ("image_height", "height")
_PROJECTIONS = ("projection_matrix", "P", "p")
_MATRICES = ("camera_matrix", "K", "k")
_DISTORTIONS = ("distortion_coefficients", "D", "d")
_ROTATIONS = ("rectification_matrix", "R", "r")


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    names = tuple(f"{name}:" for name in _PROJECTIONS)
    return all(
        not (text.is_opencv or text.text.startswith("{"))
        and any(line.startswith(names) for line in text.text.splitlines())
        for text in texts
    )


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    left, right, size = _cameras(texts)
    return from_projections(_projection(left, "left"), _projection(right, "right"), size)


def _read_raw(texts: tuple[CalibrationText, ...], size: tuple[int, int] | None) -> RawCalibration:
    left, right, own_size = _cameras(texts)
    p1, p2 = _projection(left, "left"), _projection(right, "right")
    r1, r2 = (_matrix(data, _ROTATIONS, 3, 3, view) for data, view in ((left, "left"), (right, "right")))
    own = OwnRectification((r1, r2), (p1, p2))
    # A point X of the left camera is at R1 X in the rectified one, the baseline beside it in the right one, turned
    # back by R2.
    baseline = np.array([p2[0, 3] / p2[0, 0] - p1[0, 3] / p1[0, 0], 0.0, 0.0])
    return RawCalibration(
        _view(left, "left"),
        _view(right, "right"),
        r2.T @ r1,
        r2.T @ baseline,
        agreed_size(own_size, size),
        own,
    )


def _cameras(
    texts: tuple[CalibrationText, ...],
) -> tuple[dict[str, Any], dict[str, Any], tuple[int, int]]:
    """What both files hold, and the views' size."""
    if len(texts) != 2:
        raise InputError("is one camera_info, and a pair has two: give LEFT.yaml,RIGHT.yaml")
    left, right = _camera(texts[0], "left"), _camera(texts[1], "right")
    size, other = (
        size_of(_first(data, _WIDTHS, view), _first(data, _HEIGHTS, view))
        for data, view in ((left, "left"), (right, "right"))
    )
    if size != other:
        raise InputError(f"the views are {size[0]}x{size[1]} and {other[0]}x{other[1]}")
    return left, right, size


def _camera(text: CalibrationText, view: str) -> dict[str, Any]:
    # A printed message ends with ---.
    first = text.text.removeprefix("---\n").partition("\n---")[0]
    data = mapping_of_yaml(first)
    if data is None:
        raise InputError(f"the {view} file is no camera_info")
    return data


def _projection(data: dict[str, Any], view: str) -> NDArray[np.float64]:
    projection = _matrix(data, _PROJECTIONS, 3, 4, view)
    if not projection[0, 0] > 0:
        raise InputError(f"the {view} file has no focal length in its projection: is the pair calibrated?")
    return projection


def _view(data: dict[str, Any], view: str) -> RawView:
    """The raw camera of one file."""
    model = lens_model_of(data.get("distortion_model", ""))
    values = _numbers(_first(data, _DISTORTIONS, view))
    distortion = matrix_of(values, 1, -1, _DISTORTIONS[0])[0]
    return RawView(_matrix(data, _MATRICES, 3, 3, view), distortion, model)


def _matrix(
    data: dict[str, Any], names: tuple[str, ...], rows: int, columns: int, view: str
) -> NDArray[np.float64]:
    return matrix_of(_numbers(_first(data, names, view)), rows, columns, names[0])


def _numbers(value: Any) -> Any:
    """Files have matrices as `data` with rows and columns, messages as lists."""
    return value.get("data") if isinstance(value, dict) else value


def _first(data: dict[str, Any], names: tuple[str, ...], view: str) -> Any:
    for name in names:
        if name in data:
            return data[name]
    raise InputError(f"the {view} file has no {names[0]}")


READER = CalibrationReader("a pair of ROS camera_info files", _recognises, _read, _read_raw)

"""ROS: two `camera_info` files, as `camera_calibration` writes them or as messages are printed.

    image_width: 640                          width: 640
    image_height: 480                         height: 480
    projection_matrix:                        P: [423.6, 0.0, 318.7, -38.1, ...]
      data: [423.6, 0.0, 318.7, -38.1, ...]

The left file first. The right projection holds -fx * baseline, in metres (REP 104).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from datagen.cameras.calibration import Calibration, CalibrationText, from_projections, matrix_of, size_of
from datagen.cameras.reader import CalibrationReader
from stereoforge_kit.errors import InputError

_WIDTHS, _HEIGHTS = ("image_width", "width"), ("image_height", "height")
_PROJECTIONS = ("projection_matrix", "P", "p")


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    names = tuple(f"{name}:" for name in _PROJECTIONS)
    return all(
        not (text.is_opencv or text.text.startswith("{"))
        and any(line.startswith(names) for line in text.text.splitlines())
        for text in texts
    )


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    if len(texts) != 2:
        raise InputError("is one camera_info, and a pair has two: give LEFT.yaml,RIGHT.yaml")
    (left, size), (right, right_size) = map(_camera, texts, ("left", "right"))
    if size != right_size:
        raise InputError(f"the views are {size[0]}x{size[1]} and {right_size[0]}x{right_size[1]}")
    return from_projections(left, right, size)


def _camera(text: CalibrationText, view: str) -> tuple[NDArray[np.float64], tuple[int, int]]:
    """The (3, 4) projection and the size of one view."""
    # A printed message ends with ---.
    first = text.text.removeprefix("---\n").partition("\n---")[0]
    try:
        aliases = any(isinstance(token, yaml.AliasToken) for token in yaml.scan(first, yaml.SafeLoader))
        data = None if aliases else yaml.safe_load(first)  # They could grow without end.
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(f"the {view} file is no YAML") from error
    if not isinstance(data, dict):
        raise InputError(f"the {view} file is no camera_info")
    projection = _first(data, _PROJECTIONS, view)
    values = projection.get("data") if isinstance(projection, dict) else projection
    size = size_of(_first(data, _WIDTHS, view), _first(data, _HEIGHTS, view))
    return matrix_of(values, 3, 4, "projection_matrix"), size


def _first(data: dict[str, Any], names: tuple[str, ...], view: str) -> Any:
    for name in names:
        if name in data:
            return data[name]
    raise InputError(f"the {view} file has no {names[0]}")


READER = CalibrationReader("a pair of ROS camera_info files", _recognises, _read)

"""Our own JSON: a rectified rig in eight numbers, as `cameras.json` of every scene begins too.

    {"width": 960, "height": 540, "fx": 1050.0, "fy": 1050.0,
     "cx_left": 479.5, "cx_right": 479.5, "cy": 269.5, "baseline_m": 0.12}

Other keys are left alone. The centre of the first pixel is (0, 0), as in OpenCV.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from datagen.cameras.calibration import Calibration, CalibrationText, calibration_of, size_of
from datagen.cameras.reader import CalibrationReader
from stereoforge_kit.errors import InputError

_KEYS = ("fx", "fy", "cx_left", "cx_right", "cy", "baseline_m", "width", "height")


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    return len(texts) == 1 and texts[0].text.lstrip().startswith("{")


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    try:
        data: dict[str, Any] = json.loads(texts[0].text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"is no JSON ({error})") from error
    for key in _KEYS:
        if isinstance(data.get(key), bool) or not isinstance(data.get(key), int | float):
            raise InputError(f"it needs the number {key!r}; a rig has {', '.join(_KEYS)}")
    left, right = (
        np.array([[data["fx"], 0.0, data[cx]], [0.0, data["fy"], data["cy"]], [0.0, 0.0, 1.0]], np.float64)
        for cx in ("cx_left", "cx_right")
    )
    return calibration_of(left, right, data["baseline_m"], size_of(data["width"], data["height"]))


def as_json(calibration: Calibration) -> str:
    """The text that this module reads. Raises ValueError for a calibration without a size."""
    if calibration.size is None:
        raise InputError("a calibration without a size cannot be written")
    width, height = calibration.size
    numbers = {"width": width, "height": height} | {
        key: getattr(calibration, key) for key in _KEYS if key not in ("width", "height")
    }
    return json.dumps(numbers, indent=2) + "\n"


READER = CalibrationReader("a rig as JSON", _recognises, _read)

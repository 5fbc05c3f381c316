"""Middlebury's and ETH3D's `calib.txt` (Scharstein et al., GCPR 2014).

    cam0=[3997.684 0 1176.728; 0 3997.684 1011.728; 0 0 1]
    cam1=[3997.684 0 1307.839; 0 3997.684 1011.728; 0 0 1]
    doffs=131.111
    baseline=193.001
    width=2964
    height=1988

`cam0` is the left view, the baseline is in millimetres, and doffs is the difference of the principal points.
"""

from __future__ import annotations

from datagen.cameras.calibration import Calibration, CalibrationText, calibration_of, matrix_of, size_of
from datagen.cameras.reader import CalibrationReader
from stereoforge_kit.errors import InputError

DOFFS_TOLERANCE_PX = 0.01
"""The files have three decimals."""


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    return len(texts) == 1 and "cam0" in texts[0].words("=")


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    text = texts[0]
    words = text.words("=")
    for key in ("cam0", "cam1", "baseline", "width", "height"):
        if key not in words:
            raise InputError(f"it has no {key}=, as Middlebury's calib.txt has")
    left, right = (matrix_of(text.numbers(words[key]), 3, 3, key) for key in ("cam0", "cam1"))
    size = size_of(float(words["width"]), float(words["height"]))
    found = calibration_of(left, right, float(words["baseline"]) / 1000, size)
    if "doffs" in words and abs(float(words["doffs"]) - found.doffs) > DOFFS_TOLERANCE_PX:
        raise InputError(f"its doffs {words['doffs']} is not {found.doffs:g}, cx of cam1 less cx of cam0")
    return found


READER = CalibrationReader("Middlebury's calib.txt", _recognises, _read)

"""KITTI: `calib_cam_to_cam.txt` of the raw and the stereo data, `calib.txt` of odometry and object detection
(Geiger et al., IJRR 2013).

    S_rect_02: 1.242000e+03 3.750000e+02                  P2: 7.215377e+02 0.000000e+00 6.095593e+02 ...
    P_rect_02: 7.215377e+02 0.000000e+00 6.095593e+02 ...

Cameras 2 and 3 are the colour pair; where a file lacks them, the grey pair 0 and 1 is read. `calib.txt` does not say
how large the images are.
"""

from __future__ import annotations

from datagen.cameras.calibration import Calibration, CalibrationText, from_projections, matrix_of, size_of
from datagen.cameras.reader import CalibrationReader
from stereoforge_kit.errors import InputError

_NAMES = ("P_rect_0{}", "P{}")
_PAIRS = ((2, 3), (0, 1))


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    text = texts[0]
    return len(texts) == 1 and not text.is_opencv and _projections(text.words(":")) is not None


def _projections(words: dict[str, str]) -> tuple[str, str] | None:
    """The names of the left and the right projection, or of one of them if the other is missing."""
    names = [(name.format(left), name.format(right)) for name in _NAMES for left, right in _PAIRS]
    whole = [pair for pair in names if words.keys() >= set(pair)]
    return next(iter(whole + [pair for pair in names if words.keys() & set(pair)]), None)


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    text = texts[0]
    words = text.words(":")
    names = _projections(words)
    assert names is not None
    for name in names:
        if name not in words:
            raise InputError(f"it has no {name}:, so only one view of KITTI's pair")
    left, right = (matrix_of(text.numbers(words[name]), 3, 4, name) for name in names)
    size = words.get(names[0].replace("P_rect", "S_rect"))
    return from_projections(
        left, right, size_of(*text.numbers(size)) if size and size != words[names[0]] else None
    )


READER = CalibrationReader("KITTI's calib_cam_to_cam.txt or calib.txt", _recognises, _read)

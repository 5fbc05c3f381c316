"""Stereolabs' factory calibration of a ZED camera, `SNxxxxx.conf`.

    [LEFT_CAM_HD]        [RIGHT_CAM_HD]        [STEREO]
    fx=700.12            fx=699.87             Baseline=120.02      millimetres
    fy=700.12            fy=699.87             TY=0.02, TZ=-0.1
    cx=640.3             cx=655.1              CV_HD=0.004          the rotation's vector is (RX, CV, RZ)
    cy=360.9             cy=362.7              RX_HD=-0.002
    k1=-0.17, k2, ...    ...                   RZ_HD=0.0005

It has a section for each size of the pictures; the pictures' own, or else the largest, is read. Baseline, TY and TZ say
where the right camera is, in its own frame, as Stereolabs' open programs use them (`zed-open-capture`): they are -T.
"""

from __future__ import annotations

import configparser

import cv2
import numpy as np

from datagen.cameras.calibration import Calibration, CalibrationText
from datagen.cameras.raw_calibration import RawCalibration, RawView, camera_matrix
from datagen.cameras.reader import CalibrationReader
from datagen.cameras.rectification import plan_rectification
from stereoforge_kit.errors import InputError
from stereoforge_kit.messages import listed

_SIZES = {
    "2K": (2208, 1242),
    "FHD1200": (1920, 1200),
    "FHD": (1920, 1080),
    "HD": (1280, 720),
    "SVGA": (960, 600),
    "VGA": (672, 376),
}
"""(width, height) of each section, the largest first."""
_DISTORTION = ("k1", "k2", "p1", "p2", "k3")


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    return len(texts) == 1 and "[STEREO]" in texts[0].text and "[LEFT_CAM_" in texts[0].text


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    return plan_rectification(_read_raw(texts, None)).calibration


def _read_raw(texts: tuple[CalibrationText, ...], size: tuple[int, int] | None) -> RawCalibration:
    parser = configparser.ConfigParser(interpolation=None, strict=False, inline_comment_prefixes=("#", ";"))
    try:
        parser.read_string(texts[0].text)
    except configparser.Error as error:
        raise InputError("it is no file of sections and key=value") from error
    kinds = [kind for kind in _SIZES if parser.has_section(f"LEFT_CAM_{kind}")]
    wanted = [kind for kind in kinds if size in (None, _SIZES[kind])]
    if not wanted:
        sizes = listed(["{}x{}".format(*_SIZES[kind]) for kind in kinds], most=len(_SIZES))
        own = "" if size is None else f", but these are {size[0]}x{size[1]}"
        raise InputError(f"it is of pictures of {sizes or 'no known size'}{own}")
    kind, stereo = wanted[0], "STEREO"
    left, right = (_view(parser, f"{view}_CAM_{kind}") for view in ("LEFT", "RIGHT"))
    shift = [
        _number(parser, stereo, "Baseline"),
        *(_number(parser, stereo, f"{name}_{kind}", name, missing=0.0) for name in ("TY", "TZ")),
    ]
    turn = [_number(parser, stereo, f"{name}_{kind}", name, missing=0.0) for name in ("RX", "CV", "RZ")]
    if not np.isfinite(turn).all():
        raise InputError("it has numbers that are not finite")
    rotation, _ = cv2.Rodrigues(np.array(turn))
    return RawCalibration(left, right, rotation, -np.array(shift) / 1000, _SIZES[kind])


def _view(parser: configparser.ConfigParser, section: str) -> RawView:
    distortion = np.array([_number(parser, section, name, missing=0.0) for name in _DISTORTION])
    return RawView(
        camera_matrix(*(_number(parser, section, name) for name in ("fx", "fy", "cx", "cy"))), distortion
    )


def _number(
    parser: configparser.ConfigParser, section: str, *names: str, missing: float | None = None
) -> float:
    """The first of these keys that the section has. Raises ValueError for none, unless something stands for it."""
    for name in names:
        if parser.has_option(section, name):
            return float(parser.get(section, name))
    if missing is None:
        raise InputError(f"its [{section}] has no {names[0]}")
    return missing


READER = CalibrationReader("a ZED's SNxxxxx.conf", _recognises, _read, _read_raw)

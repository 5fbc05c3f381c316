"""OpenCV's YAML, read by OpenCV: what its stereo calibration samples and `cv2.FileStorage` write.

Either the projections of the rectified pair, `P1` and `P2`, or the calibration they follow from: `K1` and `K2` (also
called `M1`, `M2` or `cameraMatrix1`, `cameraMatrix2`; `K` if they are equal), `R`, `T` and, where there is distortion,
`D1` and `D2`. A pair with parallel axes and no distortion is taken as it is; `cv2.stereoRectify` with its default
settings rectifies another.

The size is `image_width` and `image_height`, or `width` and `height`, or `imageSize`. Lengths are metres unless
`unit: mm` says otherwise.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from datagen.cameras.calibration import (
    Calibration,
    CalibrationText,
    calibration_of,
    from_projections,
    matrix_of,
    size_of,
)
from datagen.cameras.reader import CalibrationReader
from stereoforge_kit.errors import InputError

_UNITS_M = {"": 1.0, "m": 1.0, "mm": 1e-3, "cm": 1e-2}
_LEFT = ("K1", "M1", "cameraMatrix1", "K", "M")
_RIGHT = ("K2", "M2", "cameraMatrix2", "K", "M")
_PARALLEL = 1e-9
"""Elements of a rotation and shares of a baseline up to which a pair counts as rectified."""


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    return len(texts) == 1 and texts[0].is_opencv


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    try:
        storage = cv2.FileStorage(texts[0].text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        return _calibration(_Storage(storage.root()))
    except (cv2.error, SystemError) as error:
        raise InputError("OpenCV cannot read it as YAML of its own") from error


def _calibration(stored: _Storage) -> Calibration:
    unit = stored.text("unit")
    if unit not in _UNITS_M:
        raise InputError(f"its unit {unit!r:.20} is none of m, cm and mm")
    size = stored.size()
    if stored.has("P1") and stored.has("P2"):
        left, right = (stored.matrix((name,), 3, 4) for name in ("P1", "P2"))
        return from_projections(left, right, size, _UNITS_M[unit])
    left, right = stored.matrix(_LEFT, 3, 3), stored.matrix(_RIGHT, 3, 3)
    rotation, shift = stored.matrix(("R",), 3, 3), stored.matrix(("T",), 3, 1)
    distortion = [stored.distortion(names) for names in (("D1", "distCoeffs1"), ("D2", "distCoeffs2"))]
    length = float(np.linalg.norm(shift))
    parallel = (np.abs(rotation - np.eye(3)) <= _PARALLEL).all() and np.abs(
        shift[1:]
    ).max() <= _PARALLEL * length
    if parallel and not any(one.any() for one in distortion):
        # T takes points from the left camera's frame to the right one's.
        return calibration_of(left, right, -float(shift[0, 0]) * _UNITS_M[unit], size)
    if size is None:
        raise InputError("it has no image_width and image_height, which rectification needs")
    rectified = cv2.stereoRectify(left, distortion[0], right, distortion[1], size, rotation, shift)
    return from_projections(rectified[2], rectified[3], size, _UNITS_M[unit])


class _Storage:
    """The top level of a file."""

    def __init__(self, root: Any) -> None:
        self._root = root

    def has(self, name: str) -> bool:
        return not self._root.getNode(name).empty()

    def text(self, name: str) -> str:
        return self._root.getNode(name).string() if self.has(name) else ""

    def matrix(self, names: Iterable[str], rows: int, columns: int) -> NDArray[np.float64]:
        """The first of these matrices that there is."""
        for name in names:
            if self.has(name):
                return matrix_of(self._root.getNode(name).mat(), rows, columns, name)
        raise InputError(f"it has neither P1 and P2 nor {next(iter(names))}")

    def distortion(self, names: Iterable[str]) -> NDArray[np.float64]:
        found = [self._root.getNode(name).mat() for name in names if self.has(name)]
        return np.asarray(found[0], np.float64) if found else np.zeros(5)

    def size(self) -> tuple[int, int] | None:
        for width, height in (("image_width", "image_height"), ("width", "height")):
            if self.has(width) and self.has(height):
                return size_of(self._root.getNode(width).real(), self._root.getNode(height).real())
        for name in ("imageSize", "image_size", "size"):
            node = self._root.getNode(name)
            if node.isSeq() and node.size() == 2:
                return size_of(node.at(0).real(), node.at(1).real())
        return None


READER = CalibrationReader("OpenCV's YAML", _recognises, _read)

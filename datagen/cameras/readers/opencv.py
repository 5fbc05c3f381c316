"""OpenCV's YAML, read by OpenCV: what its stereo calibration samples and `cv2.FileStorage` write.

Either the projections of the rectified pair, `P1` and `P2`, or the calibration they follow from: `K1` and `K2` (also
called `M1`, `M2` or `cameraMatrix1`, `cameraMatrix2`; `K` if they are equal), `R`, `T` and, where there is distortion,
`D1` and `D2`. A pair with parallel axes and no distortion is taken as it is; `cv2.stereoRectify` with its default
settings rectifies another. `distortion_model: fisheye` or `fisheye_model: 1` says that D is of `cv2.fisheye`. Two files
are read as one: OpenCV's sample writes `intrinsics.yml,extrinsics.yml`.

The size is `image_width` and `image_height`, or `width` and `height`, or `imageSize`. Lengths are metres unless
`unit: mm` says otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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
from datagen.cameras.raw_calibration import (
    LensModel,
    OwnRectification,
    RawCalibration,
    RawView,
    agreed_size,
    lens_model_of,
)
from datagen.cameras.reader import CalibrationReader
from datagen.cameras.rectification import plan_rectification
from stereoforge_kit.errors import InputError

_UNITS_M = {"": 1.0, "m": 1.0, "mm": 1e-3, "cm": 1e-2}
_MATRICES = (
    ("K1", "M1", "cameraMatrix1", "camera_matrix_1", "K_left", "cameraMatrixL", "K", "M"),
    ("K2", "M2", "cameraMatrix2", "camera_matrix_2", "K_right", "cameraMatrixR", "K", "M"),
)
_DISTORTIONS = (
    ("D1", "distCoeffs1", "dist_coeffs_1", "D_left", "distCoeffsL", "D"),
    ("D2", "distCoeffs2", "dist_coeffs_2", "D_right", "distCoeffsR", "D"),
)
_MODELS = ("distortion_model", "camera_model", "lens_model", "model")
_FISHEYE = ("fisheye_model", "fisheye")
_OWN = ("R1", "R2", "P1", "P2")
_PARALLEL = 1e-9
"""Elements of a rotation and shares of a baseline up to which a pair counts as rectified."""


def _recognises(texts: tuple[CalibrationText, ...]) -> bool:
    return len(texts) <= 2 and all(text.is_opencv for text in texts)


def _read(texts: tuple[CalibrationText, ...]) -> Calibration:
    with _opened(texts) as stored:
        if stored.has("P1") and stored.has("P2"):
            left, right = (stored.matrix((name,), 3, 4) for name in ("P1", "P2"))
            return from_projections(left, right, stored.size(), stored.unit_m())
        if not any(map(stored.has, _MATRICES[0])):
            raise InputError("it has neither P1 and P2 nor K1")
        views, rotation, shift = _views(stored), stored.matrix(("R",), 3, 3), _shift(stored)
        length = float(np.linalg.norm(shift))
        straight = all(view.model == "brown" and not view.distortion.any() for view in views)
        turned = np.abs(rotation - np.eye(3)).max() > _PARALLEL
        if straight and not turned and np.abs(shift[1:]).max() <= _PARALLEL * length:
            # T takes points from the left camera's frame to the right one's.
            return calibration_of(views[0].matrix, views[1].matrix, -float(shift[0]), stored.size())
        raw = RawCalibration(*views, rotation, shift, agreed_size(stored.size(), None))
        return plan_rectification(raw).calibration


def _read_raw(texts: tuple[CalibrationText, ...], size: tuple[int, int] | None) -> RawCalibration:
    with _opened(texts) as stored:
        own = None
        if all(map(stored.has, _OWN)):
            p1, p2 = (stored.matrix((name,), 3, 4) for name in ("P1", "P2"))
            p1[:, 3] *= stored.unit_m()
            p2[:, 3] *= stored.unit_m()
            r1, r2 = (stored.matrix((name,), 3, 3) for name in ("R1", "R2"))
            own = OwnRectification((r1, r2), (p1, p2))
        views, rotation, shift = _views(stored), stored.matrix(("R",), 3, 3), _shift(stored)
        return RawCalibration(*views, rotation, shift, agreed_size(stored.size(), size), own)


def _views(stored: _Storage) -> tuple[RawView, RawView]:
    model = stored.model()
    left, right = (
        RawView(
            stored.matrix(matrices, 3, 3),
            stored.distortion(distortions, 4 if model == "fisheye" else 5),
            model,
        )
        for matrices, distortions in zip(_MATRICES, _DISTORTIONS, strict=True)
    )
    return left, right


def _shift(stored: _Storage) -> NDArray[np.float64]:
    """T in metres, (3,)."""
    return stored.matrix(("T",), 3, 1)[:, 0] * stored.unit_m()


@contextmanager
def _opened(texts: tuple[CalibrationText, ...]) -> Iterator[_Storage]:
    """What the files hold together. Raises ValueError for what OpenCV cannot read, then and later."""
    try:
        flags = cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
        storages = [cv2.FileStorage(text.text, flags) for text in texts]
        yield _Storage([storage.root() for storage in storages])
    except (cv2.error, SystemError) as error:
        raise InputError("OpenCV cannot read it as YAML of its own") from error


class _Storage:
    """The top level of the files; what two of them hold is the first one's."""

    def __init__(self, roots: Sequence[Any]) -> None:
        self._roots = roots

    def has(self, name: str) -> bool:
        return self._node(name) is not None

    def unit_m(self) -> float:
        """Metres in the unit of lengths."""
        unit = self.text("unit")
        if unit not in _UNITS_M:
            raise InputError(f"its unit {unit!r:.20} is none of m, cm and mm")
        return _UNITS_M[unit]

    def model(self) -> LensModel:
        if any(self.number(name) for name in _FISHEYE):
            return "fisheye"
        return lens_model_of(next(filter(None, map(self.text, _MODELS)), ""))

    def text(self, name: str) -> str:
        node = self._node(name)
        return "" if node is None else node.string()

    def number(self, name: str) -> float:
        node = self._node(name)
        return 0.0 if node is None else node.real()

    def matrix(self, names: Sequence[str], rows: int, columns: int) -> NDArray[np.float64]:
        """The first of these matrices that there is."""
        for name in names:
            if (node := self._node(name)) is not None:
                return matrix_of(node.mat(), rows, columns, name)
        raise InputError(f"it has no {names[0]}")

    def distortion(self, names: Sequence[str], coefficients: int) -> NDArray[np.float64]:
        """The first of these that there is, (N,), or so many zeros."""
        for name in names:
            if (node := self._node(name)) is not None:
                found = node.mat()
                return matrix_of(found, 1, -1 if found is None else np.size(found), name)[0]
        return np.zeros(coefficients)

    def size(self) -> tuple[int, int] | None:
        for width, height in (("image_width", "image_height"), ("width", "height")):
            if self.has(width) and self.has(height):
                return size_of(self.number(width), self.number(height))
        for name in ("imageSize", "image_size", "size"):
            node = self._node(name)
            if node is not None and node.isSeq() and node.size() == 2:
                return size_of(node.at(0).real(), node.at(1).real())
        return None

    def _node(self, name: str) -> Any:
        """The first file's node of that name; None if there is none."""
        nodes = (root.getNode(name) for root in self._roots)
        return next((node for node in nodes if not node.empty()), None)


READER = CalibrationReader("OpenCV's YAML", _recognises, _read, _read_raw)

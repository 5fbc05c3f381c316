"""What a calibration file says about a stereo pair as the cameras took it, with distortion and before rectification."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from datagen.cameras.calibration import LONGEST_BASELINE_M, matrix_of
from stereoforge_kit.errors import InputError
from stereoforge_kit.messages import listed

LensModel = Literal["brown", "fisheye"]
COEFFICIENTS: dict[LensModel, tuple[int, ...]] = {"brown": (4, 5, 8, 12, 14), "fisheye": (4,)}
"""How many numbers a lens has in OpenCV's models."""
LENS_MODELS: dict[str, LensModel] = {
    "": "brown",
    "pinhole": "brown",
    "brown": "brown",
    "brown_conrady": "brown",
    "radtan": "brown",
    "plumb_bob": "brown",
    "rational_polynomial": "brown",
    "fisheye": "fisheye",
    "equidistant": "fisheye",
    "kannala_brandt": "fisheye",
}
"""What files call the two models of lenses."""
ROTATION_TOLERANCE = 1e-3
"""Largest error of R R' that a rotation may have: files have four decimals or more."""
OUTSIDE_SHARE = 0.5
"""A principal point may lie so far outside the image, as a share of its side."""


def lens_model_of(name: Any) -> LensModel:
    """The lens model that a file names. Raises ValueError for one that is not read."""
    key = str(name).strip().lower().replace("-", "_")
    if key not in LENS_MODELS:
        known = [model for model in LENS_MODELS if model]
        raise InputError(f"its lens model {name!s:.30} is none of {listed(known, most=len(known))}")
    return LENS_MODELS[key]


@dataclass(frozen=True)
class RawView:
    """One camera. Raises ValueError for numbers that no camera has."""

    matrix: NDArray[np.float64]
    """(3, 3) K in px; the centre of the first pixel is (0, 0)."""
    distortion: NDArray[np.float64]
    """(N,) coefficients in OpenCV's order: k1, k2, p1, p2, k3, ... or, of a fisheye, k1, k2, k3, k4."""
    model: LensModel = "brown"

    def __post_init__(self) -> None:
        if not (np.isfinite(self.matrix).all() and np.isfinite(self.distortion).all()):
            raise InputError("it has numbers that are not finite")
        if not (self.matrix[0, 0] > 0 and self.matrix[1, 1] > 0):
            raise InputError(
                f"its focal lengths are {self.matrix[0, 0]:g} and {self.matrix[1, 1]:g}, not above 0"
            )
        if not np.array_equal(self.matrix[2], [0, 0, 1]) or self.matrix[1, 0] != 0:
            raise InputError("its camera matrix is not [fx 0 cx; 0 fy cy; 0 0 1]")
        counts = COEFFICIENTS[self.model]
        if self.distortion.size not in counts:
            raise InputError(
                f"a lens of the {self.model} model has {listed(sorted(counts), separator=' or ')} coefficients, not "
                f"{self.distortion.size}"
            )


@dataclass(frozen=True)
class OwnRectification:
    """How the file itself rectifies the pair, as `cv2.stereoRectify` returns it."""

    rotations: tuple[NDArray[np.float64], NDArray[np.float64]]
    """R1 and R2, (3, 3) each."""
    projections: tuple[NDArray[np.float64], NDArray[np.float64]]
    """P1 and P2, (3, 4) each, their last column in metres times px."""

    def __post_init__(self) -> None:
        for name, rotation in zip(("R1", "R2"), self.rotations, strict=True):
            check_rotation(rotation, name)


@dataclass(frozen=True)
class RawCalibration:
    """Both cameras and where the right one is. Raises ValueError for numbers that no stereo pair has."""

    left: RawView
    right: RawView
    rotation: NDArray[np.float64]
    """(3, 3) R: a point of the left camera's frame is at R X + T in the right one's."""
    translation_m: NDArray[np.float64]
    """(3,) T in metres; about (-baseline, 0, 0)."""
    size: tuple[int, int]
    """(width, height) of the pictures."""
    own: OwnRectification | None = field(default=None, compare=False)
    """How the file rectifies the pair, if it says so."""

    def __post_init__(self) -> None:
        check_rotation(self.rotation, "R")
        if not np.isfinite(self.translation_m).all():
            raise InputError("it has numbers that are not finite")
        baseline = float(np.linalg.norm(self.translation_m))
        if baseline == 0:
            raise InputError("its baseline is 0: both cameras are at one place")
        if baseline > LONGEST_BASELINE_M:
            raise InputError(f"a baseline of {baseline:g} m cannot be: is it in millimetres?")
        if self.left.model != self.right.model:
            raise InputError("one of its cameras is a fisheye and the other is not, which is not rectified")
        if self.own is not None:
            between = self.own.rotations[1].T @ self.own.rotations[0]
            if np.abs(between - self.rotation).max() > ROTATION_TOLERANCE:
                raise InputError("its R1 and R2 do not belong to its R")
        for name, view in (("left", self.left), ("right", self.right)):
            for axis, side in enumerate(self.size):
                center = view.matrix[axis, 2]
                if not -OUTSIDE_SHARE * side <= center <= (1 + OUTSIDE_SHARE) * side:
                    raise InputError(
                        f"the {name} camera's principal point is at {center:g} of {side} px: is it of another size?"
                    )


def check_rotation(matrix: NDArray[np.float64], name: str) -> None:
    """Raise ValueError, naming it, for a (3, 3) matrix that is no rotation."""
    if not np.isfinite(matrix).all():
        raise InputError("it has numbers that are not finite")
    off = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if off > ROTATION_TOLERANCE or np.linalg.det(matrix) < 0:
        raise InputError(f"its {name} is no rotation: {name} {name}' is off the identity by {off:.2g}")


def camera_matrix(fx: float, fy: float, cx: float, cy: float) -> NDArray[np.float64]:
    """The (3, 3) K of four numbers of a file. Raises ValueError for what are no numbers."""
    return matrix_of([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], 3, 3, "intrinsics")


def agreed_size(own: tuple[int, int] | None, pictures: tuple[int, int] | None) -> tuple[int, int]:
    """(width, height) of what a file and the pictures say, either of which may be None.

    Raises ValueError if they differ, or if there is neither.
    """
    if own is not None and pictures is not None and own != pictures:
        raise InputError(f"it is of pictures of {own[0]}x{own[1]}, but these are {pictures[0]}x{pictures[1]}")
    size = own or pictures
    if size is None:
        raise InputError("it has no image_width and image_height, which rectification needs")
    return size

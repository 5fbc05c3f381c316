"""What a calibration file says about a rectified stereo pair."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml
from numpy.typing import NDArray

from datagen.errors import FormatError
from stereoforge_kit.errors import InputError

if TYPE_CHECKING:
    from scenes.spec import Rig

FOCAL_TOLERANCE = 1e-4
"""Relative difference of focal lengths up to which two views are of one rectified pair."""
ROW_TOLERANCE_PX = 0.05
"""Difference of the principal points' rows up to which two views are of one rectified pair."""
LONGEST_BASELINE_M = 20.0
"""A longer one is in other units than metres."""
OFF_BY_PX = 1.0
"""A size has a rig's shape if scaling the rig to its width misses its height by less than this."""


@dataclass(frozen=True)
class Calibration:
    """Intrinsics in pixels and the baseline of a rectified pair; made by `calibration_of`.

    As in OpenCV and in all these files, the centre of the first pixel is (0, 0).
    """

    fx: float
    fy: float
    cx_left: float
    cx_right: float
    cy: float
    baseline_m: float
    size: tuple[int, int] | None = None
    """(width, height) of the images; None where the file does not say it."""

    @property
    def doffs(self) -> float:
        """Middlebury's name for cx_right - cx_left: depth = fx * baseline / (disparity + doffs)."""
        return self.cx_right - self.cx_left

    def rig(self, size: tuple[int, int] | None = None) -> Rig:
        """The rig with images of (width, height), scaled where the file's are of another size.

        Raises ValueError for a size of another shape, and for none at all.
        """
        # Here, since worlds load scipy's splines: a third of a second that depth from a calibration can do without.
        from scenes.spec import Rig

        wanted = size or self.size
        if wanted is None:
            raise InputError("the file does not say how large the images are, so --size has to")
        fitted = self.scaled_to(wanted)
        return Rig(
            *wanted,
            fitted.fx,
            fitted.fy,
            fitted.cx_left + 0.5,
            fitted.cx_right + 0.5,
            fitted.cy + 0.5,
            self.baseline_m,
        )

    def scaled_to(self, size: tuple[int, int]) -> Calibration:
        """The calibration of images that were scaled to (width, height); those of unknown size are taken as they are.

        Raises ValueError for a size of another shape.
        """
        width, height = size
        own_width, own_height = self.size or size
        if abs(width * own_height / own_width - height) >= OFF_BY_PX:
            raise InputError(
                f"images of {width}x{height} have another shape than the camera's {own_width}x{own_height}"
            )
        x, y = width / own_width, height / own_height
        return Calibration(
            self.fx * x,
            self.fy * y,
            (self.cx_left + 0.5) * x - 0.5,
            (self.cx_right + 0.5) * x - 0.5,
            (self.cy + 0.5) * y - 0.5,
            self.baseline_m,
            size,
        )


def calibration_of(
    left: NDArray[np.float64],
    right: NDArray[np.float64],
    baseline_m: float,
    size: tuple[int, int] | None = None,
) -> Calibration:
    """A calibration from both views' camera matrices after rectification.

    Args:
        left, right: (3, 3) matrices [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in px.
        baseline_m: Distance of the right camera from the left one, to the right.
        size: (width, height) in px, if known.

    Raises:
        ValueError: For numbers that are no rectified pair's, with what is wrong and without the file's name.
    """
    if not (np.isfinite(left).all() and np.isfinite(right).all() and math.isfinite(baseline_m)):
        raise InputError("it has numbers that are not finite")
    for name, matrix in (("left", left), ("right", right)):
        if not (matrix[0, 0] > 0 and matrix[1, 1] > 0):
            raise InputError(
                f"the {name} view's focal lengths are {matrix[0, 0]:g} and {matrix[1, 1]:g}, not above 0"
            )
        if abs(matrix[0, 1]) > 1e-9 * matrix[0, 0]:
            raise InputError(f"the {name} view's pixels are skewed by {matrix[0, 1]:g}")
    if not np.allclose(left[[0, 1], [0, 1]], right[[0, 1], [0, 1]], rtol=FOCAL_TOLERANCE, atol=0):
        raise InputError(
            f"the views' focal lengths {left[0, 0]:g}, {left[1, 1]:g} and {right[0, 0]:g}, {right[1, 1]:g} differ, so "
            "they are not rectified"
        )
    if abs(left[1, 2] - right[1, 2]) > ROW_TOLERANCE_PX:
        raise InputError(
            f"the views' cy {left[1, 2]:g} and {right[1, 2]:g} differ, so they are not rectified"
        )
    if baseline_m <= 0:
        raise InputError(
            f"the right camera is {-baseline_m:g} m left of the left one: are the views swapped?"
        )
    if baseline_m > LONGEST_BASELINE_M:
        raise InputError(f"a baseline of {baseline_m:g} m cannot be: is it in millimetres?")
    fx, fy, cx_left, cx_right, cy = map(float, (left[0, 0], left[1, 1], left[0, 2], right[0, 2], left[1, 2]))
    return Calibration(fx, fy, cx_left, cx_right, cy, float(baseline_m), size)


def from_projections(
    left: NDArray[np.float64],
    right: NDArray[np.float64],
    size: tuple[int, int] | None = None,
    unit_m: float = 1.0,
) -> Calibration:
    """A calibration from (3, 4) projections of a rectified pair, as `cv2.stereoRectify`, ROS and KITTI have them.

    unit_m: Metres in the unit of their last columns. Raises ValueError as `calibration_of` does.
    """
    baseline = (left[0, 3] - right[0, 3]) / left[0, 0] if left[0, 0] > 0 else math.nan
    return calibration_of(left[:, :3], right[:, :3], baseline * unit_m, size)


def size_of(width: Any, height: Any) -> tuple[int, int]:
    """(width, height) from numbers of a file. Raises ValueError for what is no size."""
    try:
        size = int(width), int(height)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"its size {width!s:.20}x{height!s:.20} is none") from error
    if min(size) < 1 or size != (width, height):
        raise InputError(f"its size {width!s:.20}x{height!s:.20} is none")
    return size


def matrix_of(values: Any, rows: int, columns: int, name: str) -> NDArray[np.float64]:
    """A (rows, columns) matrix from numbers of a file, flat or nested. Raises ValueError naming it for others."""
    try:
        matrix = np.array(values, np.float64).reshape(rows, columns)
    except (TypeError, ValueError) as error:
        raise InputError(f"its {name} is no {rows}x{columns} matrix") from error
    return matrix


def mapping_of_yaml(text: str) -> dict[str, Any] | None:
    """What YAML holds by name; None for what is no YAML, no mapping, or has aliases, which could grow without end."""
    try:
        aliases = any(isinstance(token, yaml.AliasToken) for token in yaml.scan(text, yaml.SafeLoader))
        data = None if aliases else yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError):
        return None
    return data if isinstance(data, dict) else None


@dataclass(frozen=True)
class CalibrationText:
    """A calibration file that was read."""

    name: str
    """Its path, for messages."""
    text: str

    @property
    def is_opencv(self) -> bool:
        """Whether OpenCV wrote it, whose YAML begins in a way of its own."""
        return self.text.startswith("%YAML")

    def words(self, separator: str) -> dict[str, str]:
        """What stands behind `key<separator>` in each line, by the key."""
        lines = (line.partition(separator) for line in self.text.splitlines())
        return {key.strip(): value.strip() for key, found, value in lines if found}

    def numbers(self, value: str) -> list[float]:
        """The numbers of a string, separated by blanks, commas or semicolons. Raises ValueError for other words."""
        return [float(word) for word in value.strip("[] ").replace(";", " ").replace(",", " ").split()]


def not_understood(texts: tuple[CalibrationText, ...], reason: object) -> FormatError:
    """The error about files that are no calibration, in one sentence."""
    return FormatError(f"{', '.join(text.name for text in texts)}: {reason}")

"""What the numbers in a disparity file mean: units, signs, and which numbers stand for no disparity.

| numbers | px | no disparity |
|---|---|---|
| floating | value / scale, scale 1 | NaN, infinite |
| unsigned | value / scale, scale 256 in PNG and TIFF files of 16 bits | 0 |
| signed | value / scale, scale 16 for int16 | negative |

OpenCV's matchers return int16 in units of 1/16 px, with 16 (d_min - 1) where they found nothing. People save that as
it is, cast to uint16 (where -16 becomes 65520) or to float, and divided by 16 (where -16 becomes -1). All of these are
recognised. So are maps whose sign is the other way round, as the right views of some sets and of OpenCV have it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from datagen.errors import FormatError
from datagen.formats.disparity.record import DisparityReading
from datagen.formats.limits import check_image_size

PNG_UNITS_PER_PX = 256
"""Of KITTI's 16-bit PNG files; 0 stands for no disparity."""
FIXED_POINT_UNITS_PER_PX = 16
"""Of what OpenCV's matchers return, int16; negative values stand for no disparity."""
_NOT_FOUND = -FIXED_POINT_UNITS_PER_PX
"""What OpenCV's matchers write where they find nothing, if they look from 0 px on."""
_LARGEST = np.iinfo(np.uint16).max
_NOISE_PX = 1.0
"""Values nearer to 0 do not tell the sign."""
_UNUSED_UNITS = 8
"""OpenCV's refinement moves a disparity by half a pixel at most, so no number lies so close to its marker."""


def in_pixels(
    origin: Path, stored: NDArray[Any], units_per_px: float | None, default: float | None
) -> DisparityReading:
    """The disparity that the numbers of a file stand for.

    Args:
        origin: Names the file in errors.
        stored: (H, W) numbers, with any axes of length 1.
        units_per_px: What the user says that a pixel of disparity is stored as; None if nothing is said.
        default: The same for unsigned numbers of which nothing is said; None if that cannot be known.

    Raises:
        FormatError: another shape, no numbers, or whole numbers in unknown units.
    """
    values = _two_axes(origin, stored)
    if values.dtype.kind not in "fiu":
        raise FormatError(f"{origin}: holds {values.dtype}, not numbers")
    read = {"f": _from_floats, "i": _from_signed, "u": _from_unsigned}[values.dtype.kind]
    if units_per_px is None and values.dtype.kind == "u":
        units_per_px = default if values.dtype == np.uint16 else None
    if units_per_px is None and values.dtype.kind in "iu" and values.dtype != np.int16:
        raise FormatError(
            f"{origin}: holds {values.dtype} in unknown units; say with --disparity-scale, or scale= of the data "
            "set, how many are a pixel"
        )
    disparity, remarks = read(values, units_per_px)
    turned = _seems_negated(disparity)
    if turned:
        disparity = -disparity
        remarks = (*remarks, "its disparities are negative, so the sign is turned")
    elif values.dtype.kind == "i":
        disparity = np.where(disparity < 0, np.float32(np.nan), disparity)
    return DisparityReading(disparity, remarks)


def to_units(
    disparity: NDArray[np.floating[Any]], units_per_px: float, origin: Path | None = None
) -> NDArray[np.uint16]:
    """(H, W) px as 16-bit whole numbers: 0 where the disparity is not finite, and at least 1 where it is.

    Raises FormatError, naming `origin`, for a disparity that 16 bits do not hold.

    >>> to_units(np.array([[1.5, np.nan, 0.0]]), 256).tolist()
    [[384, 0, 1]]
    """
    known = np.isfinite(disparity)
    units = np.rint(np.where(known, disparity, 0).astype(np.float64) * units_per_px)
    if units.max(initial=0) > _LARGEST:
        raise FormatError(
            f"{origin or 'the disparity'}: {units.max() / units_per_px:.1f} px are more than 16 bits hold at "
            f"{units_per_px:g} units a pixel; take a smaller scale, or PFM"
        )
    return np.where(known, np.maximum(units, 1), 0).astype(np.uint16)


def in_floats(disparity: NDArray[np.floating[Any]], units_per_px: float | None) -> NDArray[np.float32]:
    """(H, W) float32 of a disparity in px, times the units where they are given."""
    return (disparity if units_per_px is None else disparity * units_per_px).astype(np.float32)


_Read = tuple[NDArray[np.float32], tuple[str, ...]]


def _from_floats(values: NDArray[Any], units_per_px: float | None) -> _Read:
    known = values[np.isfinite(values)]
    negative = known[known < 0]
    if units_per_px is None and _is_fixed_point(known, negative):
        found = np.where(values == _NOT_FOUND, np.nan, values) / FIXED_POINT_UNITS_PER_PX
        return found.astype(np.float32), ("taken for OpenCV's fixed point, 16 units a pixel",)
    disparity = np.where(np.isfinite(values), values, np.nan).astype(np.float32)
    if negative.size and (negative == -1).all() and (known > 0).any():
        return np.where(values == -1, np.float32(np.nan), disparity / np.float32(units_per_px or 1)), (
            "-1 is taken for no disparity",
        )
    return disparity / np.float32(units_per_px or 1), ()


def _is_fixed_point(known: NDArray[Any], negative: NDArray[Any]) -> bool:
    """Whether floating numbers are whole, the only negative one OpenCV's marker, and too fine for whole pixels."""
    return bool(
        negative.size
        and (negative == _NOT_FOUND).all()
        and (known == np.rint(known)).all()
        and (known % FIXED_POINT_UNITS_PER_PX != 0).any()
    )


def _from_signed(values: NDArray[Any], units_per_px: float | None) -> _Read:
    remarks = () if units_per_px else ("int16 is taken for OpenCV's fixed point, 16 units a pixel",)
    disparity = (values / (units_per_px or FIXED_POINT_UNITS_PER_PX)).astype(np.float32)
    least = int(values.min())
    others = values[values != least]
    alone = not others.size or int(others.min()) - least >= _UNUSED_UNITS
    if alone and least < 0 and least % FIXED_POINT_UNITS_PER_PX == 0:  # 16 (d_min - 1), of any d_min
        disparity = np.where(values == least, np.float32(np.nan), disparity)
    return disparity, remarks


def _from_unsigned(values: NDArray[Any], units_per_px: float | None) -> _Read:
    assert units_per_px is not None
    marker = _NOT_FOUND + _LARGEST + 1
    rest = values[values != marker]
    if values.dtype == np.uint16 and rest.size < values.size and rest.max(initial=0) <= _LARGEST // 2:
        return np.where(values == marker, np.nan, values / FIXED_POINT_UNITS_PER_PX).astype(np.float32), (
            "taken for OpenCV's fixed point, 16 units a pixel, which marks what it did not find by 65520",
        )
    return np.where(values == 0, np.nan, values / units_per_px).astype(np.float32), ()


def _seems_negated(disparity: NDArray[np.float32]) -> bool:
    """Whether more disparities are negative than positive, and not by one number that marks what is missing."""
    negative = disparity[disparity < -_NOISE_PX]
    if negative.size <= int((disparity > _NOISE_PX).sum()):
        return False
    return bool((negative != negative[0]).any())


def _two_axes(origin: Path, stored: NDArray[Any]) -> NDArray[Any]:
    shape = tuple(length for length in stored.shape if length != 1) if stored.ndim > 2 else stored.shape
    if len(shape) != 2:
        raise FormatError(f"{origin}: a disparity is (H, W), not {stored.shape}")
    check_image_size(origin, shape[1], shape[0], 1)
    return stored.reshape(shape)

"""What a reader of calibration files is. Each module in `datagen.cameras.readers` has one as `READER`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from datagen.cameras.calibration import Calibration, CalibrationText
from datagen.cameras.raw_calibration import RawCalibration


@dataclass(frozen=True)
class CalibrationReader:
    """How one kind of calibration is recognised and read."""

    title: str
    """What it is called in messages."""
    recognises: Callable[[tuple[CalibrationText, ...]], bool]
    """Whether these files have the format. Never True for files of another one."""
    read: Callable[[tuple[CalibrationText, ...]], Calibration]
    """Raises ValueError, without the file's name, for what is missing or wrong."""
    read_raw: Callable[[tuple[CalibrationText, ...], tuple[int, int] | None], RawCalibration] | None = None
    """The same of the pair before rectification, given the pictures' (width, height) where they are known; None for a
    format that knows rectified pairs only."""

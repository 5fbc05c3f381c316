"""Reading a rig's calibration, whoever wrote it."""

from __future__ import annotations

from pathlib import Path

import datagen.cameras.readers
from datagen.cameras.calibration import Calibration, CalibrationText, not_understood
from datagen.cameras.raw_calibration import RawCalibration
from datagen.cameras.reader import CalibrationReader
from datagen.cameras.readers.stereoforge_json import as_json
from datagen.errors import FormatError
from datagen.formats.limits import read_bounded
from stereoforge_kit.discovery import modules_in
from stereoforge_kit.files import write_text

MAX_CALIBRATION_BYTES = 1 << 20
"""Largest calibration file that is read."""

READERS: tuple[CalibrationReader, ...] = tuple(
    module.READER for module in modules_in(datagen.cameras.readers)
)
"""Every format that is read."""


def read_calibration(location: str | Path) -> Calibration:
    """Read the calibration of a stereo pair.

    Args:
        location: A file; two, `LEFT,RIGHT`, where the format has one for each view.

    Raises:
        FormatError: With one sentence, for files that are missing, of no known format or of no rectified pair.
    """
    texts, reader = _recognised(location)
    try:
        return reader.read(texts)
    except ValueError as error:
        raise not_understood(texts, error) from error


def read_raw_calibration(location: str | Path, size: tuple[int, int] | None = None) -> RawCalibration:
    """Read the calibration of a stereo pair as the cameras took it.

    Args:
        location: As `read_calibration` takes it.
        size: (width, height) of the pictures. Some files hold several sizes, or none.

    Raises:
        FormatError: With one sentence, for files that are missing, of no known format, of another size or of no pair,
            and for formats of rectified pairs.
    """
    texts, reader = _recognised(location)
    if reader.read_raw is None:
        raise not_understood(texts, f"is {reader.title}, which describes rectified pairs: nothing to rectify")
    try:
        return reader.read_raw(texts, size)
    except ValueError as error:
        raise not_understood(texts, error) from error


def write_calibration(path: str | Path, calibration: Calibration) -> None:
    """Write the JSON that `read_calibration` reads. Raises ValueError for a calibration without a size."""
    write_text(Path(path), as_json(calibration))


def _recognised(location: str | Path) -> tuple[tuple[CalibrationText, ...], CalibrationReader]:
    """The texts of a file, or of two, and what reads them."""
    whole = Path(location)
    paths = [whole] if whole.exists() else [Path(part) for part in str(location).split(",")]
    texts = tuple(CalibrationText(str(path), _text(path)) for path in paths)
    for reader in READERS:
        if reader.recognises(texts):
            return texts, reader
    known = ", ".join(reader.title for reader in READERS)
    raise not_understood(texts, f"is no calibration that is known: {known}")


def _text(path: Path) -> str:
    try:
        return read_bounded(path, MAX_CALIBRATION_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: a calibration is text, but byte {error.start} is not") from error

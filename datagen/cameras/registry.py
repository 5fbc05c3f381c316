"""Reading a rig's calibration, whoever wrote it."""

from __future__ import annotations

from pathlib import Path

import datagen.cameras.readers
from datagen.cameras.calibration import Calibration, CalibrationText, not_understood
from datagen.cameras.reader import CalibrationReader
from datagen.errors import FormatError
from datagen.formats.limits import read_bounded
from stereoforge_kit.discovery import modules_in

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
    whole = Path(location)
    paths = [whole] if whole.exists() else [Path(part) for part in str(location).split(",")]
    texts = tuple(CalibrationText(str(path), _text(path)) for path in paths)
    for reader in READERS:
        if reader.recognises(texts):
            try:
                return reader.read(texts)
            except ValueError as error:
                raise not_understood(texts, error) from error
    known = ", ".join(reader.title for reader in READERS)
    raise not_understood(texts, f"is no calibration that is known: {known}")


def _text(path: Path) -> str:
    try:
        return read_bounded(path, MAX_CALIBRATION_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: a calibration is text, but byte {error.start} is not") from error

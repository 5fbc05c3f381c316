"""What the user says of the rig that took the pictures: a calibration file, or its few numbers."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from datagen.cameras.calibration import Calibration
from datagen.cameras.registry import read_calibration
from stereoforge.errors import CommandError, UsageError


@dataclass(frozen=True)
class SimpleRig:
    """Two cameras whose principal points are in the middle, but for an offset."""

    focal_px: float
    baseline_m: float
    doffs: float

    def scaled_to(self, size: tuple[int, int]) -> Calibration:
        """The calibration of pictures of (width, height)."""
        x, y = ((length - 1) / 2 for length in size)
        return Calibration(self.focal_px, self.focal_px, x, x + self.doffs, y, self.baseline_m, size)


@dataclass(frozen=True)
class KnownRig:
    """The rig of pictures of any size."""

    said: Calibration | SimpleRig

    def calibration(self, size: tuple[int, int]) -> tuple[Calibration, list[str]]:
        """The calibration of pictures of (width, height), and remarks about it.

        Raises:
            CommandError: the calibration is of pictures of another shape.
        """
        try:
            fitted = self.said.scaled_to(size)
        except ValueError as error:
            raise CommandError(f"the calibration: {error}") from error
        own = self.said.size if isinstance(self.said, Calibration) else None
        if own in (None, size):
            return fitted, []
        return fitted, [f"the calibration of {own[0]}x{own[1]} pictures was scaled to {size[0]}x{size[1]}"]

    def as_json(self) -> Any:
        """All that it says, as JSON values."""
        return json.loads(json.dumps(asdict(self.said)))


def known_rig(
    calibration: Path | None, focal_px: float | None, baseline_m: float | None, doffs: float
) -> KnownRig | None:
    """What `--calibration`, or `--focal-px`, `--baseline-m` and `--doffs`, say; None if they say nothing.

    Raises:
        UsageError: both, half of it, or numbers that cannot be.
        FormatError: a file that is no calibration.
    """
    numbers = focal_px is not None or baseline_m is not None or doffs != 0
    if calibration is not None:
        if numbers:
            raise UsageError("--calibration says what --focal-px, --baseline-m and --doffs say; choose one")
        return KnownRig(read_calibration(calibration))
    if not numbers:
        return None
    if focal_px is None or baseline_m is None:
        raise UsageError("depth needs both --focal-px and --baseline-m")
    for flag, value in (("--focal-px", focal_px), ("--baseline-m", baseline_m)):
        if not 0 < value < math.inf:
            raise UsageError(f"{flag} must be positive, got {value}")
    if not math.isfinite(doffs):
        raise UsageError(f"--doffs must be finite, got {doffs}")
    return KnownRig(SimpleRig(focal_px, baseline_m, doffs))

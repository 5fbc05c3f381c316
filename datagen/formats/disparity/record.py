"""What a format of disparity files is, and what reading one gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class DisparityFormat:
    """How the numbers of a disparity lie in a file."""

    title: str
    """In messages and documentation: "a 16-bit .png"."""
    endings: tuple[str, ...]
    """Of its files, in small letters with their dots; the first is what it writes."""
    read: Callable[[Path], NDArray[Any]]
    """The (H, W) numbers of a file as they are, of any integer or floating type. Raises FormatError."""
    write: Callable[[Path, NDArray[np.float32], float | None], None]
    """Write (H, W) px, NaN where there is none, as so many units a pixel; None for the format's own. Raises
    FormatError."""
    units_per_px: float | None = None
    """What unsigned whole numbers are divided by if nobody says; None if nobody can know."""


@dataclass(frozen=True)
class DisparityReading:
    """A disparity, and what was taken for granted to get it."""

    disparity: NDArray[np.float32]
    """(H, W) px, NaN where the file says that there is none. What cannot be is still in it."""
    remarks: tuple[str, ...] = ()
    """What a user should know of how the numbers were understood, without the file's name."""

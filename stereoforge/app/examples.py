"""Rendered pairs that come with the page, with the calibrations of their rigs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).with_name("pairs")


@dataclass(frozen=True)
class Example:
    """One pair."""

    name: str
    left: Path
    right: Path
    calibration: Path


def examples() -> list[Example]:
    """All of them, by name."""
    return [
        Example(folder.name, folder / "left.jpg", folder / "right.jpg", folder / "calibration.json")
        for folder in sorted(path for path in FOLDER.iterdir() if path.is_dir())
    ]


def is_of_example(calibration: Path) -> bool:
    """Whether it is a copy of an example's calibration."""
    return any(calibration.read_bytes() == example.calibration.read_bytes() for example in examples())

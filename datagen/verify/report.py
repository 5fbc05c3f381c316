"""The result of checking a data set."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One problem of a data set."""

    place: str
    """The file, scene or folder, relative to the data set's root."""
    message: str
    """What is wrong, as the end of a sentence that begins with the place."""
    split: str | None = None
    scene: int | None = None
    """The number of the scene; None if the problem is no finished scene's."""
    unchecked: bool = False
    """Whether something else than the scene kept it from being checked, so that it may well be intact."""

    def __str__(self) -> str:
        place = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in self.place)
        return f"{place}: {self.message}"


@dataclass(frozen=True)
class VerifyReport:
    """What was checked and what was found."""

    root: str
    """Folder or URL."""
    scenes: int
    """Number of scenes checked, like frames and files below."""
    frames: int
    files: int
    bytes_read: int
    seconds: float
    problems: tuple[Problem, ...]

    @property
    def ok(self) -> bool:
        """Whether there is no problem."""
        return not self.problems

    @property
    def megabytes_per_second(self) -> float:
        """Speed of the check in 10^6 bytes per second."""
        return self.bytes_read / 1e6 / self.seconds if self.seconds else 0.0

    def __str__(self) -> str:
        found = f"{len(self.problems)} problems" if self.problems else "no problem"
        return (
            f"{self.root}: {found} in {self.scenes} scenes, {self.frames} frames, {self.files} files, "
            f"{self.bytes_read / 1e6:.1f} MB read in {self.seconds:.1f} s "
            f"({self.megabytes_per_second:.1f} MB/s)"
        )

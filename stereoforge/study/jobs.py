"""Jobs that are done once: each has a folder named by all that decides its result."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stereoforge.progress import console
from stereoforge_kit.files import write_text
from stereoforge_kit.viewing import duration

FINISHED = "finished.json"
"""Written last into a job's folder, with the settings that named it."""
KEY_LENGTH = 12
_TRUSTED_SECONDS = 600.0


@dataclass(frozen=True)
class Job:
    """One step of a study."""

    title: str
    folder: Path
    """Its last twelve characters are the digest of `settings`, so another setting is another folder."""
    settings: Mapping[str, Any]
    expected_seconds: float
    """A guess for the machine the defaults were made on; the pace so far corrects it."""
    run: Callable[[], None]
    """Continues what an interrupted run left in the folder."""

    @property
    def key(self) -> str:
        """The digest of everything that decides the result."""
        return self.folder.name[-KEY_LENGTH:]

    @property
    def finished(self) -> bool:
        """Whether the result is there, whole."""
        return (self.folder / FINISHED).is_file()


def make_job(
    parent: Path,
    name: str,
    title: str,
    settings: Mapping[str, Any],
    seconds: float,
    run: Callable[[Path], None],
) -> Job:
    """A job whose folder is `parent/name-<digest of the settings>`; `run` is given that folder."""
    text = json.dumps(settings, sort_keys=True, default=list)
    folder = parent / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]}"
    return Job(title, folder, settings, seconds, lambda: run(folder))


def run_jobs(jobs: Sequence[Job]) -> None:
    """Run those that are not finished, in order, saying how far the whole is and how long it may still take."""
    missing = [job for job in jobs if not job.finished]
    ahead = sum(job.expected_seconds for job in missing)
    expected = 0.0
    began = time.monotonic()
    if len(missing) < len(jobs):
        console.print(f"{len(jobs) - len(missing)} of {len(jobs)} steps are done already")
    for job in missing:
        place = jobs.index(job) + 1
        left = duration((ahead - expected) * _pace(time.monotonic() - began, expected))
        console.print(f"step {place} of {len(jobs)}: {job.title}; about {left} left of the whole")
        job.folder.mkdir(parents=True, exist_ok=True)
        job.run()
        write_text(job.folder / FINISHED, json.dumps(job.settings, indent=1, default=list) + "\n")
        expected += job.expected_seconds


def _pace(elapsed: float, expected: float) -> float:
    """How many times the guesses it takes: the guesses count as much as their first ten minutes, so that the first
    step, which may be a short one, does not decide about hours."""
    return (elapsed + _TRUSTED_SECONDS) / (expected + _TRUSTED_SECONDS)

"""`stereoforge verify`: is every file of a data set what it was, and does the ground truth hold together?"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated

import tyro

from datagen.dataset.manifest import SceneManifest
from datagen.rendering.run import local_executor
from datagen.verify.dataset_check import verify_dataset
from datagen.verify.repair import broken_scenes, check_repairable, problems_left, repair_dataset
from datagen.verify.report import VerifyReport
from datagen.verify.scene_check import SAMPLED_PIXELS
from stereoforge.errors import CommandError, UsageError
from stereoforge.inputs.flag_values import shown
from stereoforge.progress import console, progress_bar

PROBLEMS_SHOWN = 50
NAMES_SHOWN = 5


@dataclass(frozen=True)
class Verify:
    """Check every file against its manifest and every disparity against its scene; exit 1 if anything is off."""

    data: Annotated[tyro.conf.Positional[str], shown("DIR")]
    """Folder of the data set, or its URL."""
    repair: bool = False
    """Render the broken scenes again, exactly those, and check them again. Each takes the old one's place when it is
    whole; whatever is intact, or only could not be checked, is not touched."""
    dry_run: bool = False
    """With --repair: say what would be rendered again, or why it cannot be, and touch nothing."""
    workers: Annotated[int | None, shown("N", "one a core")] = None
    """Worker processes."""
    geometry_pixels: Annotated[int, shown("N")] = SAMPLED_PIXELS
    """Random pixels of each view to compare with the scene's geometry; 0 leaves that out, which is most of the time."""

    def run(self) -> None:
        """Check the data set and print what is wrong, or repair it."""
        if self.workers is not None and self.workers < 1:
            raise UsageError(f"--workers must be at least 1, got {self.workers}")
        if self.geometry_pixels < 0:
            raise UsageError(f"--geometry-pixels must be at least 0, got {self.geometry_pixels}")
        if self.dry_run and not self.repair:
            raise UsageError("--dry-run goes with --repair: without it nothing is written anyway")
        report = self._verify()
        _print_problems(report)
        if self.repair and not report.ok:
            report = self._repaired(report)
        if not report.ok:
            raise CommandError(str(report))
        console.print(str(report))

    def _repaired(self, report: VerifyReport) -> VerifyReport:
        """Repair what can be; the report of the scenes rendered again. Raises CommandError if problems are left."""
        broken = broken_scenes(report.problems)
        if not broken:
            raise CommandError(
                f"{report}; no finished scene is known to be broken, so nothing is rendered again"
            )
        check_repairable(self.data, broken)
        names = ", ".join(f"{split}/{scene:04d}" for split, scene in broken[:NAMES_SHOWN])
        names += ", ..." if len(broken) > NAMES_SHOWN else ""
        if self.dry_run:
            raise CommandError(f"{report}; --repair would render {len(broken)} scenes again: {names}")
        console.print(f"{report}; rendering {len(broken)} scenes again: {names}")
        self._repair(broken)
        left = len(problems_left(self.data, report.problems, broken))
        report = self._verify(broken)
        _print_problems(report)
        if left:
            raise CommandError(f"{report}; {left} problems are of no broken scene and are left")
        return report

    def _verify(self, only: Collection[tuple[str, int]] | None = None) -> VerifyReport:
        cores = len(os.sched_getaffinity(0))
        with _progress("verifying") as on_progress:
            return verify_dataset(
                self.data,
                on_progress,
                workers=self.workers or cores,
                sampled_pixels=self.geometry_pixels,
                only=only,
            )

    def _repair(self, broken: list[tuple[str, int]]) -> None:
        with _progress("rendering") as on_progress:

            def on_scene(done: int, total: int, _: SceneManifest | None) -> None:
                on_progress(done, total)

            executor = local_executor(self.workers)
            summary = repair_dataset(self.data, broken, executor=executor, on_scene=on_scene)
        if summary.failures:
            first, count = summary.failures[0], len(summary.failures)
            raise CommandError(
                f"{self.data}: {count} scenes could not be rendered again and are as they were, {first.name} because: "
                f"{first.reason}"
            )


@contextmanager
def _progress(what: str) -> Iterator[Callable[[int, int], None]]:
    with progress_bar() as progress:
        task = progress.add_task(what, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _print_problems(report: VerifyReport) -> None:
    for problem in report.problems[:PROBLEMS_SHOWN]:
        console.print(f"  {problem}")
    if len(report.problems) > PROBLEMS_SHOWN:
        console.print(f"  and {len(report.problems) - PROBLEMS_SHOWN} more")

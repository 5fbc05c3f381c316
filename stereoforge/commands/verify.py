"""`stereoforge verify`: is every file of a data set what it was, and does the ground truth hold together?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from datagen.verify import verify_dataset
from stereoforge.errors import CommandError
from stereoforge.progress import console, progress_bar
from stereoforge.values import shown

PROBLEMS_SHOWN = 50


@dataclass(frozen=True)
class Verify:
    """Check every file against its manifest and every disparity against its scene; exit 1 if anything is off."""

    data: Annotated[tyro.conf.Positional[Path], shown("DIR")]
    """Folder of the data set."""

    def run(self) -> None:
        with progress_bar() as progress:
            task = progress.add_task("verifying", total=None)
            report = verify_dataset(
                self.data, lambda done, total: progress.update(task, completed=done, total=total)
            )
        for problem in report.problems[:PROBLEMS_SHOWN]:
            console.print(f"  {problem}", markup=False)
        if len(report.problems) > PROBLEMS_SHOWN:
            console.print(f"  and {len(report.problems) - PROBLEMS_SHOWN} more")
        if not report.ok:
            raise CommandError(str(report))
        console.print(str(report))

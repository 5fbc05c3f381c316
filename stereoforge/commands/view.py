"""`stereoforge view`: a data set to look at."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from stereoforge.errors import UsageError
from stereoforge.inputs.flag_values import shown
from stereoforge.places import check_writable, keep_apart
from stereoforge.progress import console, progress_bar


@dataclass(frozen=True)
class View:
    """Write a gallery of a data set, with statistics: one HTML file that opens from disk.

    With --compare, the statistics of two data sets side by side instead.
    """

    data: Annotated[tyro.conf.Positional[Path], shown("DIR")]
    """Folder of the data set."""
    out: Annotated[Path, shown("FILE.html")]
    """The file to write."""
    scenes: Annotated[int, shown("N")] = 24
    """How many scenes to show, evenly spread."""
    compare: Annotated[Path | None, shown("DIR", "none")] = None
    """Another data set, to put its statistics beside this one's."""

    def run(self) -> None:
        """Write the page."""
        if self.scenes < 1:
            raise UsageError(f"--scenes must be at least 1, got {self.scenes}")
        if self.out.is_dir():
            raise UsageError(f"--out {self.out} is a folder; it takes the file to write")
        keep_apart("--out", self.out, "the data set", self.data)
        keep_apart("--out", self.out, "--compare", self.compare)
        check_writable("--out", self.out.parent)
        from datagen.gallery.comparison import write_comparison
        from datagen.gallery.page import write_gallery

        with progress_bar() as progress:
            task = progress.add_task("reading", total=None)

            def show(done: int, total: int) -> None:
                progress.update(task, completed=done, total=total)

            if self.compare is None:
                write_gallery(self.data, self.out, scenes=self.scenes, progress=show)
            else:
                write_comparison(self.data, self.compare, self.out, scenes=self.scenes, progress=show)
        console.print(f"{self.out}: {self.out.stat().st_size / 1e6:.1f} MB")

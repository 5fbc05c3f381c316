"""Progress of long jobs with the time left: a bar on a terminal, lines in a log."""

from __future__ import annotations

import time
from datetime import timedelta
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

LINE_EVERY_S = 30.0
"""Between two lines where there is no terminal."""
_PACE_OVER_S = 300.0
"""What the time left is estimated from: some steps take longer than rich's half a minute."""


class JobProgress(Progress):
    """A progress display for long jobs.

    Where the output is a file or a pipe a bar would show nothing until its end, so what it says comes as a line now and
    then.

    Args:
        console: Where to.
        columns: Further text beside the count, as `rich.progress.TextColumn` takes it.
        transient: Whether the bar goes away at its end, on a terminal.
    """

    def __init__(self, console: Console, *columns: str, transient: bool = False) -> None:
        super().__init__(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            *(TextColumn(column, markup=False) for column in columns),
            TimeElapsedColumn(),
            TextColumn("gone,"),
            TimeRemainingColumn(),
            TextColumn("left"),
            console=console,
            transient=transient,
            speed_estimate_period=_PACE_OVER_S,
            disable=not console.is_terminal,
        )
        self._texts = ("{task.description}: {task.completed:.0f} of {task.total:.0f}", *columns)
        self._said = time.monotonic()

    def update(self, task_id: TaskID, **changes: Any) -> None:
        """As `rich.progress.Progress.update`."""
        super().update(task_id, **changes)
        self._say(task_id)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        """As `rich.progress.Progress.advance`."""
        super().advance(task_id, advance)
        self._say(task_id)

    def _say(self, task_id: TaskID) -> None:
        now = time.monotonic()
        if self.console.is_terminal or now - self._said < LINE_EVERY_S:
            return
        task = next(each for each in self.tasks if each.id == task_id)
        if not task.total or task.finished:
            return
        self._said = now
        line = ", ".join(text.format(task=task) for text in self._texts)
        elapsed, left = task.elapsed, task.time_remaining
        if elapsed is not None and left is not None:
            # As the bar writes it: two lines half a minute apart are not to say the same.
            line += f"; {timedelta(seconds=round(elapsed))} gone, about {duration(left)} left"
        self.console.print(line, markup=False, highlight=False, soft_wrap=True)


def duration(seconds: float) -> str:
    """A duration for people: "40 s", "12 min", "3 h 05 min", "4.2 days"."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    if minutes < 48 * 60:
        return f"{minutes // 60} h {minutes % 60:02d} min"
    return f"{seconds / 86400:.1f} days"

"""The console that every command writes to."""

from __future__ import annotations

from rich.console import Console

from stereoforge_kit.viewing import JobProgress

console = Console(highlight=False)


def progress_bar() -> JobProgress:
    """A progress display on the commands' console."""
    return JobProgress(console)

"""Where every command says what it does, and how far its long jobs are."""

from __future__ import annotations

from rich.console import Console

from stereoforge_kit.viewing import JobProgress

console = Console(highlight=False)


def progress_bar() -> JobProgress:
    return JobProgress(console)

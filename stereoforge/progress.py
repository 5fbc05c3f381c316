"""The console that every command writes to."""

from __future__ import annotations

from rich.console import Console

from stereoforge_kit.messages import LONGEST_MESSAGE, shortened
from stereoforge_kit.viewing import JobProgress

console = Console(highlight=False, markup=False)
"""Prints what it is told: a path may have brackets, which rich would take for its markup."""


def remark(sentence: str) -> None:
    """Print a sentence in one line, shortened if it is longer than any message may be."""
    console.print(shortened(sentence, LONGEST_MESSAGE), soft_wrap=True)


def progress_bar() -> JobProgress:
    """A progress display on the commands' console."""
    return JobProgress(console)

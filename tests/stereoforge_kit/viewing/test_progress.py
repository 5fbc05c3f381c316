"""Progress as it arrives on a terminal and in a log."""

from __future__ import annotations

import io
from types import SimpleNamespace

import pytest
from rich.console import Console

from stereoforge_kit.viewing import JobProgress, duration, progress


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(6.6, "7 s"), (89, "89 s"), (700, "12 min"), (11100, "3 h 05 min"), (360000, "4.2 days")],
)
def test_durations_read_as_one_says_them(seconds: float, text: str) -> None:
    assert duration(seconds) == text


@pytest.fixture
def seconds(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that stands still unless told."""
    now = [0.0]
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


def job(out: io.StringIO, seconds: list[float], terminal: bool) -> None:
    """Twenty steps of twenty seconds."""
    console = Console(file=out, force_terminal=terminal, width=200)
    with JobProgress(console, "loss {task.fields[loss]:.2f}") as shown:
        shown.get_time = lambda: seconds[0]
        bar = shown.add_task("training", total=20, loss=1.0)
        for step in range(1, 21):
            seconds[0] = 20.0 * step
            shown.update(bar, completed=step, loss=1 / step)


def test_a_log_gets_a_line_now_and_then(seconds: list[float]) -> None:
    out = io.StringIO()
    job(out, seconds, terminal=False)
    lines = out.getvalue().splitlines()
    assert lines[0].startswith("training: 2 of 20, loss 0.50")
    assert lines[4] == "training: 10 of 20, loss 0.10; 0:03:20 gone, about 3 min left"
    assert len([line for line in lines if line.startswith("training: ")]) == 9
    assert "20 of 20" not in out.getvalue()


def test_a_terminal_gets_a_bar_and_no_lines(seconds: list[float]) -> None:
    out = io.StringIO()
    job(out, seconds, terminal=True)
    assert "training: " not in out.getvalue()
    assert "20/20" in out.getvalue()
    assert "loss 0.05" in out.getvalue()

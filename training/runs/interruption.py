"""Ctrl-C and SIGTERM during a run: the step under way is finished, so that it can be kept."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""What a person at the keyboard sends, and a scheduler."""


class Interruption:
    """Whether a run has been asked to stop; a context that puts the signals' handlers back in the end.

    Until `defer`, signals do what they did before. After it the first one is noted, to be raised as KeyboardInterrupt
    by whoever sees it or at the end of the context, and the second one raises it at once. In threads beside the main
    one, signals are left as they are.
    """

    def __init__(self) -> None:
        self.requested = False
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.getsignal(number) for number in SIGNALS}
        return self

    def defer(self) -> None:
        """From now on, let the first signal be noted only."""
        for number in self._before:
            signal.signal(number, self._note)

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        # Lightning turns an interruption into SystemExit.
        if isinstance(error, SystemExit) and isinstance(error.__context__, KeyboardInterrupt):
            raise error.__context__ from None
        if error is None and self.requested:
            raise KeyboardInterrupt

    def _note(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

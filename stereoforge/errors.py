"""What a command answers when it cannot do what was asked: one sentence and an exit code."""

from __future__ import annotations


class UsageError(Exception):
    """The command was given values it cannot take: exit code 2."""


class CommandError(Exception):
    """The command was right and did not succeed: exit code 1."""

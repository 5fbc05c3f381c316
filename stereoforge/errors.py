"""Errors of commands: one sentence and an exit code."""

from __future__ import annotations

from typing import ClassVar

from stereoforge_kit.errors import UserError


class UsageError(UserError):
    """The command was given values it cannot take."""

    exit_code: ClassVar[int] = 2


class CommandError(UserError):
    """The command was right and did not succeed."""

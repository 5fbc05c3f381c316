"""The error that training and prediction raise for what a user can put right."""

from __future__ import annotations

from typing import ClassVar

from stereoforge_kit.errors import UserError


class TrainingError(UserError):
    """One sentence that says what is wrong and where."""


class UnknownDeviceError(TrainingError):
    """A name that no device has on any machine."""

    exit_code: ClassVar[int] = 2

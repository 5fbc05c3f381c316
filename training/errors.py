"""The error that training and prediction raise for what a user can put right."""

from __future__ import annotations

from stereoforge_kit.errors import UserError


class TrainingError(UserError):
    """One sentence that says what is wrong and where."""

"""What a user can get wrong when training or predicting."""

from __future__ import annotations

from stereoforge_kit.errors import UserError


class TrainingError(UserError):
    """One sentence that says what is wrong and where."""

"""Errors whose message is for a person.

The command line prints the message of a `UserError` as it is and ends with its exit code. Every other exception is a
fault of the program, a bare `ValueError` from a library too, and is reported as such.
"""

from __future__ import annotations

from typing import ClassVar

from stereoforge_kit.messages import LONGEST_MESSAGE, shortened


class UserError(Exception):
    """Something that the user can put right. The message is one whole sentence that says what is wrong and where.

    Of a message that would be longer than `LONGEST_MESSAGE` characters, for a long path or what another program said,
    the middle is left out.
    """

    exit_code: ClassVar[int] = 1

    whole: str
    """The message with its middle."""

    def __init__(self, message: str = "") -> None:
        self.whole = message
        super().__init__(message if len(message) <= LONGEST_MESSAGE else shortened(message, LONGEST_MESSAGE))


class InputError(UserError, ValueError):
    """A value, a file's content or an array that cannot be used; a `ValueError` to callers from Python."""

"""Errors whose message is for a person.

The command line prints the message of a `UserError` as it is and ends with its exit code. Every other exception is a
fault of the program, a bare `ValueError` from a library too, and is reported as such.
"""

from __future__ import annotations

from typing import ClassVar


class UserError(Exception):
    """Something that the user can put right. The message is one whole sentence that says what is wrong and where."""

    exit_code: ClassVar[int] = 1


class InputError(UserError, ValueError):
    """A value, a file's content or an array that cannot be used; a `ValueError` to callers from Python."""

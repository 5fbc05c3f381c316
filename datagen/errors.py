"""The errors a user of a data set can cause; each message is one sentence that names the file or folder."""

from __future__ import annotations

from stereoforge_kit.errors import InputError


class DatasetError(InputError):
    """A data set, or a part of it, is missing, incomplete or contradicts itself."""


class FormatError(DatasetError):
    """A file's bytes are not what its format allows, or an array cannot be stored in the format."""


class MachineError(DatasetError):
    """This machine or the calling script stops the work; no scene is at fault, and none is put in quarantine."""


class DiskFullError(DatasetError):
    """There is no room for what should be written; what is there is whole."""

"""Files that are written whole or not at all, in a folder or below a URL; temporary folders; locks."""

from stereoforge_kit.files.atomic import TEMPORARY_SUFFIX, replacing, write_bytes, write_text
from stereoforge_kit.files.locks import alone, locked
from stereoforge_kit.files.places import is_within
from stereoforge_kit.files.temporary import (
    TemporaryFolders,
    remove_folder,
    temporary_files_in,
    temporary_folder,
)
from stereoforge_kit.files.tree import LocalTree, RemoteTree, Tree, open_tree

__all__ = [
    "TEMPORARY_SUFFIX",
    "LocalTree",
    "RemoteTree",
    "TemporaryFolders",
    "Tree",
    "alone",
    "is_within",
    "locked",
    "open_tree",
    "remove_folder",
    "replacing",
    "temporary_files_in",
    "temporary_folder",
    "write_bytes",
    "write_text",
]

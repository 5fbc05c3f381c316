"""Files that are written whole or not at all, in a folder or below a URL; temporary folders; locks; walking."""

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
from stereoforge_kit.files.walk import is_data, matching, walk_files

__all__ = [
    "TEMPORARY_SUFFIX",
    "LocalTree",
    "RemoteTree",
    "TemporaryFolders",
    "Tree",
    "alone",
    "is_data",
    "is_within",
    "locked",
    "matching",
    "open_tree",
    "remove_folder",
    "replacing",
    "temporary_files_in",
    "temporary_folder",
    "walk_files",
    "write_bytes",
    "write_text",
]

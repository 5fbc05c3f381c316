"""Where files go: written whole or not at all, into a folder or below a URL; temporary ones; and who may write."""

from storage.atomic import TEMPORARY_SUFFIX, replacing, write_bytes, write_text
from storage.locks import alone, locked
from storage.temporary import TemporaryFolders, remove_folder, temporary_files_in, temporary_folder
from storage.tree import LocalTree, RemoteTree, Tree, open_tree

__all__ = [
    "TEMPORARY_SUFFIX",
    "LocalTree",
    "RemoteTree",
    "TemporaryFolders",
    "Tree",
    "alone",
    "locked",
    "open_tree",
    "remove_folder",
    "replacing",
    "temporary_files_in",
    "temporary_folder",
    "write_bytes",
    "write_text",
]

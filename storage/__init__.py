"""Where files go: written whole or not at all, into a folder or below a URL."""

from storage.atomic import TEMPORARY_SUFFIX, replacing, write_bytes, write_text
from storage.tree import LocalTree, RemoteTree, Tree, open_tree

__all__ = [
    "TEMPORARY_SUFFIX",
    "LocalTree",
    "RemoteTree",
    "Tree",
    "open_tree",
    "replacing",
    "write_bytes",
    "write_text",
]

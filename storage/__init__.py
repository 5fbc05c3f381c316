"""Where files go: written whole or not at all."""

from storage.atomic import TEMPORARY_SUFFIX, replacing, write_bytes, write_text

__all__ = ["TEMPORARY_SUFFIX", "replacing", "write_bytes", "write_text"]

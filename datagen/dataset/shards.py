"""Tar shards of samples (the WebDataset convention), read at random: an index of the members, then a seek and a read.

Shards may lie on any file system fsspec knows. A remote one is copied whole to a cache folder the first time one of
its samples is asked for, and read from there ever after.
"""

from __future__ import annotations

import hashlib
import io
import os
import tarfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import fsspec

from datagen.errors import DatasetError, FormatError
from datagen.formats.limits import MAX_FILE_BYTES
from stereoforge_kit.files import replacing

CACHE_VARIABLE = "STEREOFORGE_CACHE"
_INDICES_KEPT = 4096
_MAX_HEADER_BYTES = 1 << 20


class Extent(NamedTuple):
    """Where a member's bytes lie in its shard."""

    offset: int
    size: int


ShardIndex = dict[str, dict[str, Extent]]
"""Sample key to member (what follows the key and a dot: `left.png`) to extent, in the shard's order."""


def list_shards(location: str) -> list[str]:
    """The URLs of the tar files of a folder, or the one tar file named, sorted. Raises DatasetError."""
    try:
        system, path = fsspec.core.url_to_fs(location)
        found = [path] if path.endswith(".tar") else sorted(system.glob(f"{path.rstrip('/')}/*.tar"))
        return [system.unstrip_protocol(name) for name in found]
    except (OSError, ValueError, ImportError) as error:
        raise DatasetError(f"{location}: cannot be listed ({error})") from error


def read_sample_member(shard: str, key: str, member: str) -> bytes | None:
    """The bytes of one member of a sample, None where the sample has no such member. Raises DatasetError."""
    path = local_copy(shard)
    extent = shard_index(path)[key].get(member)
    if extent is None:
        return None
    try:
        with path.open("rb") as file:
            file.seek(extent.offset)
            return file.read(extent.size)
    except OSError as error:
        raise FormatError(f"{path}: cannot be read: {error.strerror}") from error


class _HeaderFile(io.FileIO):
    """A file in which tarfile finds headers: it would ask for, and allocate, whatever one of them declares."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or not 0 <= size <= _MAX_HEADER_BYTES:
            raise tarfile.ReadError(f"a header declares {size} bytes of names")
        return super().read(size) or b""


@lru_cache(maxsize=_INDICES_KEPT)
def shard_index(path: Path) -> ShardIndex:
    """What a shard holds, from its headers alone. Raises FormatError for a damaged shard."""
    index: ShardIndex = {}
    try:
        with _HeaderFile(path) as file, tarfile.open(fileobj=file, mode="r:") as shard:
            size = os.fstat(file.fileno()).st_size
            for entry in shard:
                if not entry.isfile():
                    continue
                bounded = 0 <= entry.size <= min(MAX_FILE_BYTES, size - entry.offset_data)
                if not bounded or entry.issparse():
                    raise FormatError(f"{path}: is cut off, or its member {entry.name!r} is not a plain file")
                key, _, member = entry.name.rpartition("/")[2].partition(".")
                index.setdefault(key, {})[member] = Extent(entry.offset_data, entry.size)
    except (tarfile.TarError, OSError, ValueError, ArithmeticError, RecursionError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{path}: is not an intact tar file ({error})") from error
    return index


@lru_cache(maxsize=_INDICES_KEPT)
def local_copy(shard: str) -> Path:
    """The shard itself if it is a local file, else its copy in the cache, made if need be. Raises DatasetError."""
    try:
        system, path = fsspec.core.url_to_fs(shard)
        if "file" in _protocols(system):
            return Path(path)
        # The checksum changes with the shard, so a shard that was written again is fetched again.
        digest = hashlib.sha256(f"{shard} {system.checksum(path)}".encode()).hexdigest()
        copy = cache_folder() / digest[:32] / path.rpartition("/")[2]
        if not copy.is_file():
            with replacing(copy) as temporary:
                system.get_file(path, str(temporary))
    except (OSError, ValueError, ImportError) as error:
        raise DatasetError(f"{shard}: cannot be fetched ({error})") from error
    return copy


def cache_folder() -> Path:
    """Where copies of remote shards are kept: $STEREOFORGE_CACHE, or `stereoforge` in the user's cache folder."""
    given = os.environ.get(CACHE_VARIABLE)
    if given:
        return Path(given)
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "stereoforge"


def _protocols(system: fsspec.AbstractFileSystem) -> Sequence[str]:
    return (system.protocol,) if isinstance(system.protocol, str) else system.protocol

"""Random access to tar shards of samples (the WebDataset convention, github.com/webdataset/webdataset).

A shard's headers give an index of its members; a member is then read by a seek. Shards may be on any file system that
fsspec knows. A remote shard is copied whole to a cache folder when one of its samples is first read.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import tarfile
from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from functools import lru_cache
from glob import has_magic
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import fsspec

from datagen.errors import DatasetError, FormatError
from datagen.formats.limits import MAX_FILE_BYTES
from stereoforge_kit.files import is_data, replacing

CACHE_VARIABLE = "STEREOFORGE_CACHE"
"""The environment variable that names the cache folder."""
_INDICES_KEPT = 4096
_MOST_SHARDS = 1_000_000
_BRACES = re.compile(r"\{(?:(?P<first>\d{1,9})\.\.(?P<last>\d{1,9})|(?P<list>[^{}]*,[^{}]*))\}")
_MAX_HEADER_BYTES = 1 << 20


class Extent(NamedTuple):
    """Where a member's bytes are in its shard, in bytes."""

    offset: int
    size: int


ShardIndex = dict[str, dict[str, Extent]]
"""For each sample key, in the shard's order, the extents of its members. A member's name is what follows the key and
a dot, such as `left.png`."""


def list_shards(location: str) -> list[str]:
    """The sorted URLs of a folder's tar files, or those of the tar files named.

    Tar files are named as WebDataset names them: `train-000000.tar`, `train-{000000..000003}.tar`, `{a,b}.tar`,
    `train-*.tar`. What exists as it is written, such as a folder `set[1]`, is no pattern. Raises DatasetError if
    the location cannot be listed.
    """
    try:
        return [shard for part in _alternatives(location) for shard in _list(part)]
    except (OSError, ValueError, ImportError) as error:
        if isinstance(error, DatasetError):
            raise
        raise DatasetError(f"{location}: cannot be listed ({error})") from error


def names_shards(location: str) -> bool:
    """Whether a location names tar files, not a folder of them."""
    return location.endswith((".tar", "}"))


def _list(location: str) -> list[str]:
    system, path = fsspec.core.url_to_fs(location)
    folder, _, name = path.rpartition("/")
    if not path.endswith(".tar"):
        found = _children(system, path, "*.tar")
    elif not has_magic(path) or system.exists(path):
        found = [path]
    elif not has_magic(folder) or system.isdir(folder):
        found = _children(system, folder, name)
    else:
        found = sorted(system.glob(path))
    return [system.unstrip_protocol(name) for name in found]


def _children(system: fsspec.AbstractFileSystem, folder: str, pattern: str) -> list[str]:
    """The paths of the data in a folder whose names match; the folder's name is no pattern."""
    try:
        paths = system.ls(folder, detail=False)
    except (FileNotFoundError, NotADirectoryError):
        return []
    names = ((path.rstrip("/").rpartition("/")[2], path) for path in paths)
    return sorted(path for name, path in names if fnmatchcase(name, pattern) and is_data(name))


def _alternatives(location: str) -> list[str]:
    """A location with its braces expanded, except where they are part of a name that exists."""
    if "{" not in location or _exists(location):
        return [location]
    folder, slash, name = location.rpartition("/")
    literal = f"{folder}{slash}" if "{" in folder and _exists(folder) else ""
    alternatives = [f"{literal}{part}" for part in _expand(name if literal else location)]
    if len(alternatives) > _MOST_SHARDS:
        raise DatasetError(f"{location}: names more than {_MOST_SHARDS} files")
    return alternatives


def _exists(location: str) -> bool:
    system, path = fsspec.core.url_to_fs(location)
    return bool(system.exists(path))


def _expand(text: str) -> Iterator[str]:
    """The texts that a shell's brace expansion gives: `{00..12}` with as many digits, `{a,b}`; at most one too many.

    >>> list(_expand("{a,b}-{08..10}"))
    ['a-08', 'a-09', 'a-10', 'b-08', 'b-09', 'b-10']
    """
    braces = _BRACES.search(text)
    if braces is None:
        yield text
        return
    before, after = text[: braces.start()], text[braces.end() :]
    first, last = braces["first"], braces["last"]
    if first is None:
        inner: Iterable[str] = braces["list"].split(",")
    else:
        inner = (f"{number:0{len(first)}d}" for number in range(int(first), int(last) + 1))
    every = (f"{before}{part}{rest}" for part in inner for rest in _expand(after))
    yield from islice(every, _MOST_SHARDS + 1)


def read_sample_member(shard: str, key: str, member: str) -> bytes | None:
    """The bytes of one member of a sample, None if the sample has no such member.

    Raises KeyError if the shard has no such sample, and DatasetError if it cannot be read.
    """
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
    """A file for tarfile's headers with a limit: tarfile reads, and allocates, whatever size a header declares."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or not 0 <= size <= _MAX_HEADER_BYTES:
            raise tarfile.ReadError(f"a header declares {size} bytes of names")
        return super().read(size) or b""


@lru_cache(maxsize=_INDICES_KEPT)
def shard_index(path: Path) -> ShardIndex:
    """The index of a local shard, from its headers alone. Raises FormatError for a damaged shard."""
    index: ShardIndex = {}
    try:
        with _HeaderFile(path) as file, tarfile.open(fileobj=file, mode="r:") as shard:
            size = os.fstat(file.fileno()).st_size
            for entry in shard:
                if not entry.isfile() or not is_data(entry.name):
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
    """The path of a shard on this machine: its own if it is local, else that of a copy in the cache.

    Raises DatasetError if the shard cannot be fetched.
    """
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
    """The folder for copies of remote files: $STEREOFORGE_CACHE, or `stereoforge` in the user's cache folder."""
    given = os.environ.get(CACHE_VARIABLE)
    if given:
        return Path(given)
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "stereoforge"


def _protocols(system: fsspec.AbstractFileSystem) -> Sequence[str]:
    return (system.protocol,) if isinstance(system.protocol, str) else system.protocol

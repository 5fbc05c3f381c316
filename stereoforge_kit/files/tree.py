"""A tree of files somewhere: in a folder on this machine, or below any URL that fsspec knows.

Files have relative names with forward slashes. What is written appears whole or not at all: by rename in a
folder, by the upload's end in an object store.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from stereoforge_kit.errors import InputError
from stereoforge_kit.files.atomic import replacing, write_bytes
from stereoforge_kit.files.temporary import temporary_folder
from stereoforge_kit.files.walk import is_data, walk_files


class Tree(Protocol):
    """What a data set needs of the place it lies in."""

    @property
    def name(self) -> str:
        """Folder or URL, for messages."""
        ...

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""
        ...

    def read(self, name: str) -> bytes:
        """A file's content. Raises FileNotFoundError."""
        ...

    def write(self, name: str, data: bytes) -> None:
        """Replace a file's whole content in one step."""
        ...

    def files_in(self, folder: str) -> list[str]:
        """The names, without the folder's, of the files and folders directly in a folder; none if there is none.

        Hidden files and those that desktops leave are not listed, here and in `files_below`.
        """
        ...

    def adopt(self, source: Path, name: str) -> None:
        """Make a local file, or a folder with its files, this tree's; a file of the same name is replaced.

        What else there is in a folder of that name may be replaced with it.
        """
        ...

    def files_below(self, folder: str) -> list[str]:
        """The names of all files in a folder and its folders, relative to the tree; none if there is none."""
        ...

    def writing(self, name: str) -> AbstractContextManager[Path]:
        """A local path to write a file's content to, which becomes the tree's at the end, or nothing does."""
        ...

    def fetch(self, name: str, target: Path) -> None:
        """Copy a file to a local path, whole or not at all. Raises FileNotFoundError."""
        ...

    def remove(self, name: str) -> None:
        """Remove a file, or a folder with all that is in it, if it is there."""
        ...


@dataclass(frozen=True)
class LocalTree:
    """A folder of this machine, or of a file system that it shares with others."""

    root: Path

    @property
    def name(self) -> str:
        return str(self.root)

    def exists(self, name: str) -> bool:
        return (self.root / name).is_file()

    def read(self, name: str) -> bytes:
        return (self.root / name).read_bytes()

    def write(self, name: str, data: bytes) -> None:
        write_bytes(self.root / name, data)

    def files_in(self, folder: str) -> list[str]:
        try:
            return sorted(path.name for path in (self.root / folder).iterdir() if is_data(path.name))
        except (FileNotFoundError, NotADirectoryError):
            return []

    def files_below(self, folder: str) -> list[str]:
        found = walk_files(self.root / folder)
        return sorted(path.relative_to(self.root).as_posix() for path in found)

    def writing(self, name: str) -> AbstractContextManager[Path]:
        return replacing(self.root / name)

    def adopt(self, source: Path, name: str) -> None:
        target = self.root / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir():
            shutil.rmtree(target)
        source.replace(target)

    def fetch(self, name: str, target: Path) -> None:
        write_bytes(target, self.read(name))

    def remove(self, name: str) -> None:
        path = self.root / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            with suppress(FileNotFoundError):
                path.unlink()


@dataclass(frozen=True)
class RemoteTree:
    """Everything below a URL such as s3://bucket/folder."""

    url: str

    @property
    def name(self) -> str:
        return self.url

    @cached_property
    def _place(self) -> tuple[Any, str]:
        import fsspec

        filesystem, path = fsspec.core.url_to_fs(self.url, use_listings_cache=False)
        return filesystem, path.rstrip("/")

    def __getstate__(self) -> dict[str, Any]:
        return {"url": self.url}  # Connections do not travel to other processes.

    def _path(self, *names: str) -> str:
        return "/".join(part for part in (self._place[1], *names) if part)

    def exists(self, name: str) -> bool:
        return bool(self._place[0].isfile(self._path(name)))

    def read(self, name: str) -> bytes:
        return bytes(self._place[0].cat_file(self._path(name)))

    def write(self, name: str, data: bytes) -> None:
        path = self._path(name)
        self._make_folder_of(path)
        self._place[0].pipe_file(path, data)

    def files_in(self, folder: str) -> list[str]:
        try:
            found = self._place[0].ls(self._path(folder), detail=False)
        except FileNotFoundError:
            return []
        names = (path.rstrip("/").rpartition("/")[2] for path in found)
        return sorted(name for name in names if name and is_data(name))

    def files_below(self, folder: str) -> list[str]:
        filesystem, root = self._place
        names = (path.removeprefix(f"{root}/") for path in filesystem.find(self._path(folder)))
        return sorted(filter(is_data, names))

    @contextmanager
    def writing(self, name: str) -> Iterator[Path]:
        with temporary_folder() as folder:
            path = folder / PurePosixPath(name).name
            yield path
            self.adopt(path, name)

    def adopt(self, source: Path, name: str) -> None:
        for file in _files_below(source):
            target = self._path(name, file.relative_to(source).as_posix() if file != source else "")
            self._make_folder_of(target)
            self._place[0].put_file(str(file), target)

    def fetch(self, name: str, target: Path) -> None:
        write_bytes(target, self.read(name))

    def remove(self, name: str) -> None:
        with suppress(FileNotFoundError):
            self._place[0].rm(self._path(name), recursive=True)

    def _make_folder_of(self, path: str) -> None:
        """Stores without folders do nothing here; other file systems behind a URL need it."""
        self._place[0].makedirs(path.rpartition("/")[0], exist_ok=True)


def open_tree(root: Path | str) -> Tree:
    """The tree at a folder, or at a URL with "://" in it.

    Raises ValueError, one sentence, for a URL of a kind that fsspec does not know or has no package for, and
    ModuleNotFoundError without fsspec.
    """
    if "://" not in str(root):
        return LocalTree(Path(root))
    tree = RemoteTree(str(root).rstrip("/"))
    try:
        _ = tree._place
    except (ValueError, ImportError) as error:
        if isinstance(error, ModuleNotFoundError):
            raise
        raise InputError(f"{root}: {error} (pip install 'stereoforge[cloud]' brings s3://)") from error
    return tree


def _files_below(source: Path) -> Iterator[Path]:
    if source.is_file():
        yield source
    else:
        yield from walk_files(source)

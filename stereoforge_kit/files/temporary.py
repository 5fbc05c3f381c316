"""Temporary folders that are removed whatever happens to the process that made them.

Their maker holds a lock on a file in the folder for as long as it lives, and the system frees that lock
however the process ends. A folder whose lock is free is abandoned: whoever next makes one beside it, or ends
with its own, clears it away.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

LOCK = "lock"
_GUARD = ".guard"
_MISSES = 1000
"""How often in a row a folder may vanish between being made and being used."""
_VARIABLES = ("TMPDIR", "TMP", "TEMP")
"""Where programs look for the folder of temporary files: Blender at TMP first, Python at TMPDIR."""


def remove_folder(folder: Path) -> None:
    """Remove a folder with all that is in it, if it is there."""
    with suppress(FileNotFoundError):
        shutil.rmtree(folder)


@dataclass(frozen=True)
class TemporaryFolders:
    """Makes temporary folders in `parent`, which comes and goes with them."""

    parent: Path
    clear: Callable[[Path], None] = remove_folder
    """What removes a folder, one's own or an abandoned one."""
    private: bool = False
    """Nobody else may look into the parent, or have made it."""

    @contextmanager
    def new(self) -> Iterator[Path]:
        """A new folder, cleared away at the end, as are those that were abandoned beside it."""
        with self._guarding():
            self._clear_abandoned()
            folder = Path(tempfile.mkdtemp(prefix="", dir=self.parent))
            lock = (folder / LOCK).open("a")
            _lock(lock)
        try:
            yield folder
        finally:
            with lock, self._guarding():
                self.clear(folder)
                # Workers of a run that was killed a moment ago may have lived until now.
                self._clear_abandoned()

    @contextmanager
    def _guarding(self) -> Iterator[None]:
        """Keep other processes from making or clearing folders in the parent meanwhile."""
        guard, locked = self._take_guard()
        try:
            yield
        finally:
            with guard, suppress(OSError):
                if locked and [path.name for path in self.parent.iterdir()] == [_GUARD]:
                    (self.parent / _GUARD).unlink()
                    self.parent.rmdir()

    def _take_guard(self) -> tuple[IO[str], bool]:
        """The parent's own lock file, and whether it could be locked."""
        missed = 0
        while True:
            try:
                self.parent.mkdir(parents=True, exist_ok=True, mode=0o700 if self.private else 0o777)
                if self.private and self.parent.lstat().st_uid != os.getuid():
                    raise PermissionError(13, "belongs to somebody else", str(self.parent))
                guard = (self.parent / _GUARD).open("a")
            except (FileNotFoundError, FileExistsError):
                missed += 1
                if missed == _MISSES:  # It cannot be made: a link to nowhere, or no place for folders.
                    raise
                continue  # Whoever used the parent last has just removed it.
            locked = _lock(guard)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(guard.fileno()), (self.parent / _GUARD).stat()):
                    return guard, locked
            guard.close()

    def _clear_abandoned(self) -> None:
        for folder in self.parent.iterdir():
            if folder.is_dir() and _is_abandoned(folder):
                self.clear(folder)


def temporary_folder(place: Path | None = None) -> AbstractContextManager[Path]:
    """A new folder in the system's place for temporary files, or another one, removed at the end.

    What killed commands of the same user have left there is removed too. Raises PermissionError if somebody
    else has made the folder that all these lie in.
    """
    parent = (place or Path(tempfile.gettempdir())) / f"stereoforge-{os.getuid()}"
    return TemporaryFolders(parent, private=True).new()


@contextmanager
def temporary_files_in(folder: Path) -> Iterator[None]:
    """Let this process, and libraries that ask the environment, put temporary files into an existing folder."""
    before = {name: os.environ.get(name) for name in _VARIABLES}
    os.environ.update(dict.fromkeys(_VARIABLES, str(folder)))
    python_before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        yield
    finally:
        tempfile.tempdir = python_before
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _lock(file: IO[str]) -> bool:
    """Wait for a lock; False where the file system has none, so that no folder there ever counts as abandoned."""
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_EX)
        return True
    return False


def _is_abandoned(folder: Path) -> bool:
    """To be asked under the guard: a folder that is just being made has no lock yet."""
    with suppress(OSError), (folder / LOCK).open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False

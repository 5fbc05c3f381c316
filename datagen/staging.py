"""Where scenes are made before they are committed, so that whatever is killed leaves nothing behind.

Every run works in a folder of its own, `.staging/<run>`, and holds a lock on a file in it for as long as it
lives. A folder whose lock is free belongs to a run that is gone: whoever finds it clears it away, and with it
what its unfinished scenes had already moved into the data set.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from datagen.layout import SPLITS, Layout
from storage import LocalTree, Tree

STAGING_FOLDER = ".staging"
_LOCK = "lock"
_NEW = ".new-"


@dataclass(frozen=True)
class StagingArea:
    """A run's own folder; scenes are staged in folders `<split>-<scene>-<random>` below it."""

    folder: Path

    def scene_folder(self, split: str, scene: int) -> Path:
        """A new, empty folder; no other attempt at the scene, wherever it runs, has the same."""
        self.folder.mkdir(parents=True, exist_ok=True)  # Another machine has temporary files of its own.
        return Path(tempfile.mkdtemp(prefix=f"{split}-{scene}-", dir=self.folder))

    @contextmanager
    def committing(self, split: str, scene: int) -> Iterator[None]:
        """Keep two attempts at one scene, of which one was given up too early, from mixing their files."""
        with (self.folder / f"{split}-{scene}.commit").open("w") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield

    def unfinished_scenes(self) -> set[tuple[str, int]]:
        """(split, scene) of every scene that is, or was, being made in here."""
        found = set()
        for path in self.folder.iterdir():
            split, _, rest = path.name.partition("-")
            number = rest.split("-")[0]
            if path.is_dir() and split in SPLITS and number.isdigit():
                found.add((split, int(number)))
        return found


@contextmanager
def staging_area(tree: Tree) -> Iterator[StagingArea]:
    """A new staging area for a run into `tree`, cleared away at the end, with those of runs that are gone.

    It lies in the data set's folder, where a scene can be moved into place, or in the system's folder for
    temporary files if the data set is behind a URL.
    """
    parent = _parent_folder(tree)
    if parent.is_dir():
        _clear_abandoned(parent, tree)
    area, lock = _make_area(parent)
    try:
        yield area
    finally:
        _clear(area, tree)
        lock.close()
        with suppress(OSError):  # Another run may still be using it.
            parent.rmdir()


def _parent_folder(tree: Tree) -> Path:
    if isinstance(tree, LocalTree):
        return tree.root / STAGING_FOLDER
    place = hashlib.sha256(tree.name.encode()).hexdigest()[:16]
    return Path(tempfile.gettempdir()) / f"stereoforge-staging-{os.getuid()}-{place}"


def _make_area(parent: Path) -> tuple[StagingArea, IO[str]]:
    """A new folder that is locked before it gets the name by which others would find it."""
    while True:
        parent.mkdir(parents=True, exist_ok=True, mode=0o755)
        try:
            new = Path(tempfile.mkdtemp(prefix=_NEW, dir=parent))
            break
        except FileNotFoundError:  # A run that has just ended has removed the empty parent folder.
            continue
    lock = (new / _LOCK).open("w")
    with suppress(OSError):  # Where there are no locks, folders of others never count as abandoned either.
        fcntl.flock(lock, fcntl.LOCK_EX)
    folder = new.with_name(f"{socket.gethostname()}-{os.getpid()}-{new.name.removeprefix(_NEW)}")
    return StagingArea(new.rename(folder)), lock


def _clear_abandoned(parent: Path, tree: Tree) -> None:
    for folder in parent.iterdir():
        if folder.name.startswith(_NEW):
            continue
        try:
            lock = (folder / _LOCK).open("r+")
        except OSError:
            continue  # Another run is just making, or just clearing it.
        with lock:
            if _is_free(lock):
                _clear(StagingArea(folder), tree)


def _is_free(lock: IO[str]) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _clear(area: StagingArea, tree: Tree) -> None:
    """Remove an area, and from the data set whatever its unfinished scenes had put there already."""
    with suppress(FileNotFoundError):
        for split, scene in area.unfinished_scenes():
            discard_uncommitted(tree, split, scene)
        shutil.rmtree(area.folder)


def discard_uncommitted(tree: Tree, split: str, scene: int) -> None:
    """Remove the files of a scene that has no manifest."""
    *parts, manifest = (path.as_posix() for path in Layout(Path()).scene_paths(split, scene))
    if not tree.exists(manifest):
        for part in parts:
            tree.remove(part)

"""Staging: scenes are made apart and then committed, so that a killed run leaves nothing behind.

In a data set's folder every run has a staging area of its own, `.staging/<run>`, and keeps it locked while it lives. An
area whose lock is free belongs to a run that is gone. The next run removes it, and also what its unfinished scenes had
already moved into the data set. Behind a URL scenes are staged in the temporary files of the machine that renders
them, in folders locked in the same way. What was uploaded of an unfinished scene is replaced when the scene is
rendered again.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from datagen.dataset.layout import SPLITS, Layout, SceneKey
from stereoforge_kit.files import (
    LocalTree,
    TemporaryFolders,
    Tree,
    locked,
    remove_folder,
    temporary_files_in,
    temporary_folder,
)

STAGING_FOLDER = ".staging"
"""The data set's folder of staging areas."""
COMMITS = "commits"
"""Name of the lock that every commit of an area shares, and that clearing the area takes alone."""


@dataclass(frozen=True)
class StagingArea:
    """The folder of one run, removed at its end."""

    folder: Path
    within_tree: bool
    """Whether it is in the data set's folder, where all machines that render can reach it."""

    @contextmanager
    def scene_folder(self, split: str, scene: int) -> Iterator[Path]:
        """A new, empty folder for one attempt at a scene. This process's temporary files are beside it meanwhile."""
        with self._attempt(split, scene) as attempt:
            staged, temporary = attempt / "scene", attempt / "temporary"
            staged.mkdir()
            temporary.mkdir()
            with temporary_files_in(temporary):
                yield staged

    @contextmanager
    def _attempt(self, split: str, scene: int) -> Iterator[Path]:
        if not self.within_tree:
            with temporary_folder() as folder:
                yield folder
            return
        folder = Path(tempfile.mkdtemp(prefix=f"{split}-{scene}-", dir=self.folder))
        try:
            yield folder
        finally:
            remove_folder(folder)

    @contextmanager
    def committing(self, split: str, scene: int) -> Iterator[None]:
        """Commit a scene alone: two attempts at it, one given up too early, must not mix their files.

        Behind a URL nothing keeps them apart, but attempts on machines of one kind upload the same bytes.
        """
        if not self.within_tree:
            yield
            return
        with locked(self.folder / COMMITS, shared=True), locked(self.folder / f"{split}-{scene}.commit"):
            yield


@contextmanager
def staging_area(tree: Tree) -> Iterator[StagingArea]:
    """A new staging area for a run into `tree`. At the end it is removed, and so are those of runs that are gone."""
    if not isinstance(tree, LocalTree):
        with temporary_folder() as folder:
            yield StagingArea(folder, within_tree=False)
        return
    folders = TemporaryFolders(tree.root / STAGING_FOLDER, partial(_clear, tree))
    with folders.new() as folder:
        yield StagingArea(folder, within_tree=True)


def _clear(tree: Tree, area: Path) -> None:
    """Remove a staging area, and what its unfinished scenes had already moved into the data set.

    A commit that another machine is making is waited for; no other begins.
    """
    with (
        suppress(FileNotFoundError),
        locked(area / COMMITS),
    ):  # Somebody may have removed the whole data set.
        for split, scene in _unfinished_scenes(area):
            discard_uncommitted(tree, split, scene)
        remove_folder(area)


def _unfinished_scenes(area: Path) -> set[SceneKey]:
    """(split, number) of every scene that was being made in an area."""
    found = set()
    for path in area.iterdir():
        split, _, rest = path.name.partition("-")
        number = rest.split("-")[0]
        if path.is_dir() and split in SPLITS and number.isdigit():
            found.add((split, int(number)))
    return found


def discard_uncommitted(tree: Tree, split: str, scene: int) -> None:
    """Remove the files of a scene that has no manifest."""
    *parts, manifest = (path.as_posix() for path in Layout(Path()).scene_paths(split, scene))
    if not tree.exists(manifest):
        for part in parts:
            tree.remove(part)

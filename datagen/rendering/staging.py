"""Staging: scenes are made apart and then committed, so that a killed run leaves nothing behind.

In a data set's folder every run has a staging area of its own, `.staging/<run>`, and keeps it locked while it lives. An
area whose lock is free belongs to a run that is gone, and the next run removes it. A scene that is whole in there says
so in a file, its commit record, before the first of its files is moved into the data set; whoever clears the area
finishes the move. So nothing is ever taken out of a data set but by what takes its place. Behind a URL scenes are
staged in the temporary files of the machine that renders them, in folders locked in the same way. What was uploaded of
an unfinished scene is removed by its run, or replaced when the scene is rendered again.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath

from datagen.dataset.layout import FOLDERS, Layout, SceneKey
from datagen.dataset.manifest import SceneManifest, read_manifest
from datagen.rendering.quarantine import release
from stereoforge_kit.files import (
    LocalTree,
    TemporaryFolders,
    Tree,
    locked,
    remove_folder,
    temporary_files_in,
    temporary_folder,
    write_text,
)

STAGING_FOLDER = ".staging"
"""The data set's folder of staging areas."""
COMMITS = "commits"
"""Name of the lock that every commit of an area shares, and that clearing the area takes alone."""
COMMIT_RECORD = "commit.json"
"""The file beside a staged scene that says that the scene is whole, and what it replaces."""
SCENE = "scene"


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
            staged, temporary = attempt / SCENE, attempt / "temporary"
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
        done = False
        try:
            yield folder
            done = True
        finally:
            if done or not (folder / COMMIT_RECORD).exists():
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
    """Remove a staging area, after what it had begun to move into the data set is there.

    A commit that another machine is making is waited for; no other begins.
    """
    with (
        suppress(FileNotFoundError),
        locked(area / COMMITS),
    ):  # Somebody may have removed the whole data set.
        for attempt in sorted(path for path in area.iterdir() if path.is_dir()):
            with suppress(ValueError, KeyError):  # After a power cut files may be empty: nothing to go by.
                if finished := finish_commit(tree, attempt):
                    release(tree, *finished)
        remove_folder(area)


def manifest_digest(tree: Tree, split: str, scene: int) -> str | None:
    """SHA-256 of a scene's manifest as it is, damaged or not; None if there is none."""
    name = Layout(Path()).manifest(split, scene).as_posix()
    return hashlib.sha256(tree.read(name)).hexdigest() if tree.exists(name) else None


def commit(tree: Tree, staged: Path, split: str, scene: int, replaces: str | None) -> None:
    """Move a staged scene, which is whole, into the data set, its manifest last.

    Args:
        tree: The data set's folder or URL.
        staged: The folder of `StagingArea.scene_folder`.
        split, scene: Which scene it is.
        replaces: `manifest_digest` of the scene whose place it takes; None where there is none. If another has taken
            that place meanwhile, nothing is done.
    """
    record = {"split": split, "scene": scene, "replaces": replaces}
    write_text(staged.parent / COMMIT_RECORD, json.dumps(record))
    finish_commit(tree, staged.parent)


def finish_commit(tree: Tree, attempt: Path) -> SceneKey | None:
    """Move what is left of a staged scene, if its commit was begun and no other attempt has been faster.

    Returns (split, number) of the scene if it was moved, else None. Raises ValueError or KeyError for a record or a
    manifest that is damaged.
    """
    path = attempt / COMMIT_RECORD
    if not path.is_file():
        return None
    record = json.loads(path.read_text())
    split, scene, replaces = record["split"], record["scene"], record["replaces"]
    if manifest_digest(tree, split, scene) != replaces:
        return None
    staged = attempt / SCENE
    manifest = Layout(staged).manifest(split, scene)
    files = sorted(file for file in staged.rglob("*") if file.is_file() and file != manifest)
    units = files if replaces else sorted({_unit(file, staged) for file in files})
    for source in units:
        name = source.relative_to(staged).as_posix()
        if not (replaces and _is_same(tree, name, source)):
            tree.adopt(source, name)
    place = manifest.relative_to(staged).as_posix()
    for name in _outdated(tree, place, read_manifest(manifest)) if replaces else ():
        tree.remove(name)
    tree.adopt(manifest, place)
    return split, scene


def begun_before(tree: Tree, splits: Iterable[str]) -> set[SceneKey]:
    """(split, number) of every scene that has a folder of files of any kind behind a URL, finished or not."""
    found = set()
    for split in splits:
        for path in Layout(Path()).scene_paths(split, 0)[: len(FOLDERS)]:
            folder = path.parent.as_posix()
            found |= {(split, int(name)) for name in tree.files_in(folder) if name.isdigit()}
    return found


def discard_uncommitted(tree: Tree, split: str, scene: int) -> None:
    """Remove what was uploaded of a scene that has no manifest and was not there before the run."""
    *parts, manifest = (path.as_posix() for path in Layout(Path()).scene_paths(split, scene))
    if not tree.exists(manifest):
        for part in parts:
            tree.remove(part)


def _is_same(tree: Tree, name: str, source: Path) -> bool:
    """Whether the data set has a file with the same bytes."""
    try:
        return tree.exists(name) and tree.read(name) == source.read_bytes()
    except OSError:  # What cannot be read is replaced.
        return False


def _outdated(tree: Tree, name: str, new: SceneManifest) -> list[str]:
    """The files that a scene has by its present manifest, if that can be read, and not by its new one."""
    try:
        old = json.loads(tree.read(name))
        listed = {PurePosixPath(entry["path"]) for entry in old["files"]}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []
    listed -= {PurePosixPath(entry.path) for entry in new.files}
    parts = Layout(Path()).scene_paths(new.split, new.scene)[:-1]
    # A damaged manifest may name any path.
    own = (path for path in listed if ".." not in path.parts and any(map(path.is_relative_to, parts)))
    return sorted(path.as_posix() for path in own)


def _unit(path: Path, root: Path) -> Path:
    """What is moved as a whole with a staged file: the folder that it is in, or the scene's single record."""
    kind, split, group, scene, *_ = path.relative_to(root).parts
    return root / kind / split / group / scene

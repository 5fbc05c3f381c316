"""A data set behind a URL, read through copies in a folder of this machine."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from datagen.dataset.layout import Layout
from datagen.dataset.shards import cache_folder
from datagen.errors import DatasetError
from stereoforge_kit.files import LocalTree, Tree, write_bytes


@dataclass(frozen=True)
class RemoteLayout(Layout):
    """Paths in the folder of copies; `local` fetches what is not there yet."""

    source: Tree
    """Where the data set is."""

    @property
    def tree(self) -> Tree:
        return self.source

    def local(self, path: Path) -> Path:
        """Copy a file to its path, unless it is there. Raises DatasetError if the other side does not answer."""
        name = self.relative(path)
        is_manifest = name.startswith("manifest/")
        if path.exists() and not is_manifest:
            return path
        try:
            if is_manifest:
                self._renew_scene(path, name)
            else:
                self.source.fetch(name, path)
        except FileNotFoundError:
            pass  # Whoever reads it says so.
        except OSError as error:
            raise DatasetError(f"{self.source.name}/{name}: cannot be read: {error}") from error
        return path

    def _renew_scene(self, manifest: Path, name: str) -> None:
        """Fetch a scene's manifest again, and forget the scene's copies if it is another one now."""
        data = self.source.read(name)
        if manifest.exists() and manifest.read_bytes() != data:
            self.forget(manifest.parent.parent.name.lower(), int(manifest.stem))
        write_bytes(manifest, data)

    def forget(self, split: str, scene: int) -> None:
        """Remove the copies of a scene."""
        copies = LocalTree(self.root)
        for path in self.scene_paths(split, scene):
            copies.remove(self.relative(path))


def open_remote(tree: Tree, folder: Path | None = None) -> RemoteLayout:
    """The layout of a data set behind a URL, with copies in `folder` or the user's cache.

    Raises DatasetError where there is no data set.
    """
    layout = RemoteLayout(folder or _cache_folder(tree), tree)
    with suppress(FileNotFoundError):
        layout.recipe.unlink()  # It may have grown.
    layout.local(layout.recipe)
    if not layout.recipe.is_file():
        raise DatasetError(f"{tree.name}: is not a data set, it has no {layout.recipe.name}")
    return layout


def _cache_folder(tree: Tree) -> Path:
    return cache_folder() / hashlib.sha256(tree.name.encode()).hexdigest()[:24]

"""A remote cache: a data set behind a URL, read through copies in a folder of this machine."""

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
    """The layout of a data set behind a URL. Its paths are in the cache; `local` fetches what is not there yet."""

    source: Tree
    """The URL of the data set."""

    @property
    def tree(self) -> Tree:
        """The URL of the data set."""
        return self.source

    def local(self, path: Path) -> Path:
        """Fetch a file into the cache unless it is there, and return its path.

        A manifest is fetched each time: a scene may have been rendered again. A file that does not exist stays
        missing. Raises DatasetError if the server does not answer.
        """
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
        """Fetch a scene's manifest again, and remove the scene's copies if it has changed."""
        data = self.source.read(name)
        if manifest.exists() and manifest.read_bytes() != data:
            self.forget(manifest.parent.parent.name.lower(), int(manifest.stem))
        write_bytes(manifest, data)

    def forget(self, split: str, scene: int) -> None:
        """Remove a scene's copies from the cache."""
        copies = LocalTree(self.root)
        for path in self.scene_paths(split, scene):
            copies.remove(self.relative(path))


def open_remote(tree: Tree, folder: Path | None = None) -> RemoteLayout:
    """The layout of a data set behind a URL, cached in `folder`, by default in the user's cache folder.

    Raises DatasetError if there is no data set.
    """
    layout = RemoteLayout(folder or _cache_folder(tree), tree)
    for path in (layout.recipe, layout.asset_pool):
        with suppress(FileNotFoundError):
            path.unlink()  # The data set may have grown.
        layout.local(path)
    if not layout.recipe.is_file():
        raise DatasetError(f"{tree.name}: is not a data set, it has no {layout.recipe.name}")
    return layout


def _cache_folder(tree: Tree) -> Path:
    return cache_folder() / hashlib.sha256(tree.name.encode()).hexdigest()[:24]

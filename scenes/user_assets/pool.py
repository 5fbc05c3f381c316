"""User assets as records: meshes, textures and environments that name the user's files by their content.

A store is a folder of prepared files, `<sha256 of the original>.npz`, made by `datagen.recipe.assets`. Records
hold the hash only, so they mean the same on any machine; `use_store` tells a process where the stores are.
Because names are contents, it does not matter in which store a file is found.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.mesh import Mesh
from scenes.spec import Shape, Texture
from stereoforge_kit.errors import InputError

_SHA256 = re.compile(r"[0-9a-f]{64}")
_stores: list[Path] = []

LEAST_FILES = {"train": 1, "test": 2, "val": 3}
"""How many files of a kind there must be for a split to have one, by the split."""


class AssetStoreError(InputError):
    """A prepared file of the user's is in no store, or damaged: not the world that asks for it is at fault."""


def use_store(folder: Path) -> None:
    """Add a folder of prepared files to those in which this process looks."""
    if folder not in _stores:
        _stores.append(folder)


def _check_sha256(text: str) -> None:
    if not _SHA256.fullmatch(text):
        raise InputError(f"a user's file is named by its SHA-256, not {text[:80]!r}")


def _load(sha256: str) -> dict[str, NDArray[np.generic]]:
    """The arrays of a prepared file. Raises AssetStoreError for a file that is in no store, or only damaged."""
    _check_sha256(sha256)
    damaged = None
    for folder in _stores:
        path = folder / f"{sha256}.npz"
        if path.is_file():
            try:
                with np.load(path, allow_pickle=False) as arrays:
                    return dict(arrays)
            except (ValueError, EOFError, KeyError, RuntimeError, BadZipFile, zlib.error, struct.error):
                damaged = path
    if damaged:
        raise AssetStoreError(f"{damaged}: is damaged; give the folders of your files again")
    raise AssetStoreError(
        f"the user's file {sha256[:12]}... is in no store; give the folders it came from again"
    )


@dataclass(frozen=True)
class Asset:
    """One of the user's files. Raises ValueError for a hash or a split that is none."""

    name: str
    """Its file name, for messages."""
    sha256: str
    """SHA-256 of its bytes, 64 hexadecimal digits."""
    split: str
    """The one split that may use it."""

    def __post_init__(self) -> None:
        _check_sha256(self.sha256)
        if self.split not in LEAST_FILES:
            raise InputError(f"a user's file is for one of {', '.join(LEAST_FILES)}, not {self.split[:80]!r}")


def spread_over_splits(names: Mapping[str, str], known: Iterable[Asset] = ()) -> tuple[Asset, ...]:
    """The files of one kind, each with its split: about 80 % train, 10 % val, 10 % test.

    A file that is known keeps its split, so that a pool that grows never shows in test what was trained on. The split
    of a new one follows from its SHA-256 alone, unless that leaves a split without any, as it often does with a few
    files. Then the split that has most gives a new one away. A single file is for train, and the second is for test.

    Args:
        names: The files' names by their SHA-256.
        known: Files whose splits are decided; those that are not among `names` are left out.
    """
    splits = {asset.sha256: asset.split for asset in known if asset.sha256 in names}
    new = sorted(names.keys() - splits.keys())
    splits |= {sha256: _split_by_content(sha256) for sha256 in new}
    needs = {split: int(len(splits) >= least) for split, least in LEAST_FILES.items()}
    for needy, least in needs.items():
        counts = Counter(splits.values())
        spare = [sha256 for sha256 in new if counts[splits[sha256]] > needs[splits[sha256]]]
        if counts[needy] < least and spare:
            splits[max(spare, key=lambda sha256: counts[splits[sha256]])] = needy
    return tuple(Asset(names[sha256], sha256, splits[sha256]) for sha256 in sorted(names))


def _split_by_content(sha256: str) -> str:
    share = int(sha256[:8], 16) / 2**32
    return "train" if share < 0.8 else "val" if share < 0.9 else "test"


@dataclass(frozen=True)
class AssetPool:
    """The user's files that a sampler may draw from; false where there are none."""

    meshes: tuple[Asset, ...] = ()
    textures: tuple[Asset, ...] = ()
    environments: tuple[Asset, ...] = ()
    share: float | None = field(default=None, metadata={"omit_default": True})
    """Share (0..1) of what can be replaced that is made from these files; None for the family's own."""

    def __post_init__(self) -> None:
        if self.share is not None and not 0 < self.share <= 1:
            raise InputError(
                f"the share of the user's files must be above 0 and at most 1, got {self.share:g}"
            )

    def __bool__(self) -> bool:
        return bool(self.files)

    @property
    def files(self) -> tuple[Asset, ...]:
        """The files of all kinds."""
        return (*self.meshes, *self.textures, *self.environments)

    def of_split(self, split: str) -> AssetPool:
        """The files that a split may use."""
        kinds = (self.meshes, self.textures, self.environments)
        meshes, textures, environments = (
            tuple(asset for asset in kind if asset.split == split) for kind in kinds
        )
        return AssetPool(meshes, textures, environments, self.share)


@dataclass(frozen=True)
class UserMesh(Shape):
    """A mesh of the user's, fitted to the unit cube. `mesh` raises ValueError where its file is in no store."""

    sha256: str

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:  # noqa: ARG003
        raise InputError("the user's meshes are drawn from an AssetPool")

    def mesh(self) -> Mesh:
        arrays = _load(self.sha256)
        return Mesh(
            np.asarray(arrays["vertices"], np.float64),
            np.asarray(arrays["triangles"], np.int32),
            np.asarray(arrays["corner_uv"], np.float32),
            smooth=True,
        )


@dataclass(frozen=True)
class UserTexture(Texture):
    """A picture of the user's. `image` raises ValueError where its file is in no store."""

    sha256: str

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:  # noqa: ARG003
        raise InputError("the user's textures are drawn from an AssetPool")

    def image(self) -> NDArray[np.uint8]:
        return np.asarray(_load(self.sha256)["image"], np.uint8)


@dataclass(frozen=True)
class UserEnvironment(Texture):
    """An equirectangular picture of the user's, which lights the scene with its whole dynamic range."""

    sha256: str

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:  # noqa: ARG003
        raise InputError("the user's environments are drawn from an AssetPool")

    def radiance(self) -> NDArray[np.float32]:
        """(H, W, 3) linear RGB of mean luminance 0.5, row 0 at the top."""
        return np.asarray(_load(self.sha256)["radiance"], np.float32)

    def image(self) -> NDArray[np.uint8]:
        """The radiance clipped to 0..1, as 8-bit sRGB."""
        return np.rint(np.clip(self.radiance(), 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)


USER_SHAPES: dict[str, type[Shape]] = {"UserMesh": UserMesh}
USER_TEXTURES: dict[str, type[Texture]] = {"UserTexture": UserTexture, "UserEnvironment": UserEnvironment}

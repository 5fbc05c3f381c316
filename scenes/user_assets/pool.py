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
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Self
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from scenes.geometry.mesh import Mesh
from scenes.spec import OMIT_DEFAULT, Material, Shape, Texture, World
from scenes.textures.plain import SolidColor
from stereoforge_kit.errors import InputError

_SHA256 = re.compile(r"[0-9a-f]{64}")
_MATERIAL_ARRAYS = ("finishes", "colors", "picture_of", "finish_of")
"""What `datagen.recipe.preparation.mesh_surfaces` stores of a mesh's materials, beside their pictures."""
MOST_EV = 20.0
"""Most stops by which environments may be brighter or darker than usual."""
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


def _load(sha256: str, *names: str, optional: bool = False) -> dict[str, NDArray[np.generic]]:
    """Arrays of a prepared file, by their names; if they are `optional`, those of them that it has.

    Raises AssetStoreError for a file that is in no store, or only damaged.
    """
    _check_sha256(sha256)
    damaged = None
    for folder in _stores:
        path = folder / f"{sha256}.npz"
        if path.is_file():
            try:
                with np.load(path, allow_pickle=False) as arrays:
                    wanted = [name for name in names if name in arrays.files or not optional]
                    return {name: arrays[name] for name in wanted}
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


def spread_over_splits(
    names: Mapping[str, str],
    known: Mapping[str, str] | None = None,
    group_of: Mapping[str, str] | None = None,
) -> tuple[Asset, ...]:
    """The files of one kind, each with its split: about 80 % train, 10 % val, 10 % test.

    A file that is known keeps its split, so that a pool that grows never shows in test what was trained on. The split
    of a new one follows from its SHA-256 alone, unless that leaves a split without any, as it often does with a few
    files. Then the split that has most gives a new one away. A single file is for train, and the second is for test.
    Files of one group, such as meshes that share a texture, have one split.

    Args:
        names: The files' names by their SHA-256.
        known: Splits that are decided, by the SHA-256 of files; those that are not among `names` do not matter.
        group_of: The group, by any text, of those files that are not each a group of its own.
    """
    known, group_of = known or {}, group_of or {}
    groups = {sha256: group_of.get(sha256, sha256) for sha256 in names}
    splits = {groups[sha256]: known[sha256] for sha256 in sorted(names) if sha256 in known}
    new = sorted(set(groups.values()) - splits.keys())
    splits |= {group: _split_by_content(group) for group in new}
    needs = {split: int(len(splits) >= least) for split, least in LEAST_FILES.items()}
    for needy, least in needs.items():
        counts = Counter(splits.values())
        spare = [group for group in new if counts[splits[group]] > needs[splits[group]]]
        if counts[needy] < least and spare:
            splits[max(spare, key=lambda group: counts[splits[group]])] = needy
    return tuple(
        Asset(names[sha256], sha256, known.get(sha256, splits[groups[sha256]])) for sha256 in sorted(names)
    )


def _split_by_content(sha256: str) -> str:
    share = int(sha256[:8], 16) / 2**32
    return "train" if share < 0.8 else "val" if share < 0.9 else "test"


@dataclass(frozen=True)
class AssetPool:
    """The user's files that a sampler may draw from; false where there are none."""

    meshes: tuple[Asset, ...] = ()
    textures: tuple[Asset, ...] = ()
    environments: tuple[Asset, ...] = ()
    share: float | None = field(default=None, metadata=OMIT_DEFAULT)
    """Share (0..1) of what can be replaced that is made from these files; None for the family's own."""
    keep_materials: bool = field(default=True, metadata=OMIT_DEFAULT)
    """Whether meshes keep the materials that their files have; otherwise they get the family's own."""
    keep_size: bool = field(default=False, metadata=OMIT_DEFAULT)
    """Whether a mesh is as large as its file says, in metres; otherwise it is scaled to what it replaces."""
    environment_ev: float = field(default=0.0, metadata=OMIT_DEFAULT)
    """How much brighter than usual the light of the environments is, in stops."""

    def __post_init__(self) -> None:
        if self.share is not None and not 0 < self.share <= 1:
            raise InputError(
                f"the share of the user's files must be above 0 and at most 1, got {self.share:g}"
            )
        if not abs(self.environment_ev) <= MOST_EV:
            raise InputError(
                f"the exposure of the user's environments must be within {MOST_EV:g} stops, got {self.environment_ev:g}"
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
        return replace(self, meshes=meshes, textures=textures, environments=environments)

    def mesh(self, asset: Asset) -> UserMesh:
        """The shape of one of the meshes, with its own materials if they are to be kept and it has any."""
        own = UserMesh(asset.sha256, own_materials=True)
        return own if self.keep_materials and own.materials() else UserMesh(asset.sha256)

    def world(self, world: World, environment: Asset) -> World:
        """A world with one of the environments."""
        sky: Texture = UserEnvironment(environment.sha256)
        return replace(world, environment=sky, strength=world.strength * 2.0**self.environment_ev)


@dataclass(frozen=True)
class UserMesh(Shape):
    """A mesh of the user's, fitted to the unit cube. Its methods raise ValueError where its file is in no store."""

    sha256: str
    own_materials: bool = field(default=False, metadata=OMIT_DEFAULT)
    """Whether it has the texture coordinates and the slots of its own materials; otherwise it is box mapped."""

    @classmethod
    def sample(cls, rng: np.random.Generator) -> Self:  # noqa: ARG003
        raise InputError("the user's meshes are drawn from an AssetPool")

    def mesh(self) -> Mesh:
        uv, slots = ("own_uv", "slots") if self.own_materials else ("corner_uv", None)
        arrays = _load(self.sha256, "vertices", "triangles", uv, *([slots] if slots else []))
        return Mesh(
            np.asarray(arrays["vertices"], np.float64),
            np.asarray(arrays["triangles"], np.int32),
            np.asarray(arrays[uv], np.float32),
            smooth=True,
            slots=np.asarray(arrays[slots], np.int32) if slots else None,
        )

    def half_size(self) -> float:
        """Half the longest side of its bounding box in the unit of its file."""
        return float(_load(self.sha256, "half_size")["half_size"])

    def materials(self) -> tuple[Material, ...]:
        """The materials that its file has, one for each slot; none if it has none."""
        arrays = _load(self.sha256, *_MATERIAL_ARRAYS, optional=True)
        if len(arrays) < len(_MATERIAL_ARRAYS):
            return ()
        rows = zip(*(arrays[name].tolist() for name in _MATERIAL_ARRAYS), strict=True)
        return tuple(self._material(*row) for row in rows)

    def _material(self, numbers: list[float], srgb: list[int], picture: int, finish: int) -> Material:
        roughness, specular, metallic, transmission, emission = numbers
        red, green, blue = srgb
        color: Texture = (
            SolidColor((red, green, blue)) if picture < 0 else UserMeshTexture(self.sha256, picture)
        )
        return Material(
            color,
            roughness=roughness,
            specular=specular,
            metallic=metallic,
            transmission=transmission,
            emission=emission,
            finish=None if finish < 0 else UserMeshTexture(self.sha256, finish),
        )


@dataclass(frozen=True)
class UserMeshTexture(Texture):
    """A picture of a mesh of the user's. `image` raises ValueError where the mesh's file is in no store."""

    sha256: str
    """The mesh's."""
    number: int
    """Which of its pictures."""

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:  # noqa: ARG003
        raise InputError("the user's textures come with their meshes")

    def image(self) -> NDArray[np.uint8]:
        name = f"picture_{self.number}"
        return np.asarray(_load(self.sha256, name)[name], np.uint8)


@dataclass(frozen=True)
class UserTexture(Texture):
    """A picture of the user's. `image` raises ValueError where its file is in no store."""

    sha256: str

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:  # noqa: ARG003
        raise InputError("the user's textures are drawn from an AssetPool")

    def image(self) -> NDArray[np.uint8]:
        return np.asarray(_load(self.sha256, "image")["image"], np.uint8)


@dataclass(frozen=True)
class UserEnvironment(Texture):
    """An equirectangular picture of the user's, which lights the scene with its whole dynamic range."""

    sha256: str

    @classmethod
    def sample(cls, rng: np.random.Generator, size: int) -> Self:  # noqa: ARG003
        raise InputError("the user's environments are drawn from an AssetPool")

    def radiance(self) -> NDArray[np.float32]:
        """(H, W, 3) linear RGB of mean luminance 0.5, row 0 at the top."""
        return np.asarray(_load(self.sha256, "radiance")["radiance"], np.float32)

    def image(self) -> NDArray[np.uint8]:
        """The radiance clipped to 0..1, as 8-bit sRGB."""
        return np.rint(np.clip(self.radiance(), 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)


USER_SHAPES: dict[str, type[Shape]] = {"UserMesh": UserMesh}
USER_TEXTURES: dict[str, type[Texture]] = {
    "UserTexture": UserTexture,
    "UserMeshTexture": UserMeshTexture,
    "UserEnvironment": UserEnvironment,
}

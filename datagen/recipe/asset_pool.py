"""The pool of user assets beside a recipe: its file, what it has for each split, and how two pools differ."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from functools import lru_cache

from datagen.dataset.layout import SPLITS
from datagen.errors import DatasetError
from scenes.serialization import from_plain, to_plain
from scenes.user_assets.pool import Asset, AssetPool
from stereoforge_kit.messages import shortened

ASSET_KINDS = ("meshes", "textures", "environments")
"""The fields of `AssetPool` that hold files, named as their flags are."""
MAX_POOL_BYTES = 1 << 28
"""Largest pool file that is read: more than a million files."""


@lru_cache(maxsize=4)
def pool_to_text(pool: AssetPool) -> str:
    """The files of a pool as JSON text, which `pool_from_text` reads: name, SHA-256 and split of each."""
    files = to_plain(pool)
    return json.dumps({kind: files[kind] for kind in ASSET_KINDS}, indent=1) + "\n"


def pool_sha256(pool: AssetPool) -> str:
    """The SHA-256 of the pool's file, by which a recipe names it."""
    return hashlib.sha256(pool_to_text(pool).encode()).hexdigest()


def pool_from_text(text: bytes, origin: str) -> AssetPool:
    """A pool from its file's content. Raises DatasetError, naming `origin`, for anything else."""
    try:
        if len(text) > MAX_POOL_BYTES:
            raise ValueError(f"{len(text)} bytes are more than any has")
        return from_plain(json.loads(text.decode("utf-8")), AssetPool)
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{origin} is no list of user assets: {shortened(str(error), 150)}") from error


def describe_splits(pool: AssetPool) -> list[str]:
    """A sentence for each kind of user assets that there are: how many files each split has."""
    sentences = []
    for name in ASSET_KINDS:
        if files := getattr(pool, name):
            counts = [f"{len(getattr(pool.of_split(split), name))} {split}" for split in SPLITS]
            sentences.append(f"{name}: {len(files)} files, {', '.join(counts)}")
    return sentences


def require_assets(pool: AssetPool, splits: Iterable[str]) -> None:
    """Raise DatasetError for a split without any file of a kind that there are files of."""
    for split in splits:
        of_split = pool.of_split(split)
        for name in ASSET_KINDS:
            files = getattr(pool, name)
            if files and not getattr(of_split, name):
                raise DatasetError(
                    f"split {split} has none of the {len(files)} files of --{name}, each of which is used in one split "
                    "only; with three files or more every split has some"
                )


def pool_difference(before: AssetPool, after: AssetPool) -> str | None:
    """What sets the files of two pools apart, for a sentence; None if they are the same."""
    old, new = (
        dict.fromkeys((kind, file) for kind in ASSET_KINDS for file in getattr(pool, kind))
        for pool in (before, after)
    )
    parts = [
        f"{len(only)} {what} ({shortened(only[0].name, 60)})"
        for what, only in (("more", _only(new, old)), ("fewer", _only(old, new)))
        if only
    ]
    return " and ".join(parts) or None


def _only(files: Iterable[tuple[str, Asset]], others: dict[tuple[str, Asset], None]) -> list[Asset]:
    return [asset for kind, asset in files if (kind, asset) not in others]

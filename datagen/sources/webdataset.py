"""WebDataset shards as `stereoforge export` writes them (docs/conventions.md).

The shards are `<split>-%06d.tar`, local or at any URL that fsspec opens: a folder of them, or as WebDataset names
them, `set/train-{000000..000003}.tar` or `set/train-*.tar`. Their samples `<split>-<scene>-<frame>` have
members that are encoded as the files of the native tree. Gradients are derived from the disparity, which gives the same
numbers as the native tree has. Everything else is read.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import groupby
from math import isfinite
from operator import itemgetter
from pathlib import Path
from typing import Any, overload

import fsspec
import numpy as np
from numpy.typing import NDArray

from datagen.dataset.layout import SPLITS
from datagen.dataset.manifest import OWN_DIGEST, FileEntry, check_seal, file_entries
from datagen.dataset.shards import list_shards, local_copy, names_shards, read_sample_member, shard_index
from datagen.errors import DatasetError, FormatError
from datagen.formats.occlusion import labels_of
from datagen.formats.pfm import decode_pfm, first_channel
from datagen.formats.png import decode_png
from datagen.sources.registry import SourceFormat
from datagen.sources.stereo_frame import FileFrame, StereoFrame
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import matching

INDEX_NAME = "index.json"
"""The file that lists the shards of a folder, their samples and their SHA-256."""
META = "meta.json"
"""The member that describes its sample, with the SHA-256 of the others."""
_DESCRIPTIONS_KEPT = 256
_KEY = re.compile(rf"((?:{'|'.join(SPLITS)})-\d{{4,}})-\d{{4,}}")
_SHARD_NAME = re.compile(rf"({'|'.join(SPLITS)})-\d{{6,}}\.tar")


@dataclass(frozen=True)
class ShardFrames(Sequence[StereoFrame]):
    """The samples of one split's shards, in order.

    If the folder has an index, a shard is opened only when one of its samples is read.
    """

    samples: tuple[tuple[str, str], ...]
    """(shard, key) of every sample."""

    def __len__(self) -> int:
        return len(self.samples)

    @overload
    def __getitem__(self, index: int) -> StereoFrame: ...

    @overload
    def __getitem__(self, index: slice) -> ShardFrames: ...

    def __getitem__(self, index: int | slice) -> StereoFrame | ShardFrames:
        if isinstance(index, slice):
            return ShardFrames(self.samples[index])
        return _frame(*self.samples[index])

    @property
    def family(self) -> str | None:
        """The family of the worlds, from the description of the first sample; None if it has none.

        Raises FormatError for a damaged description.
        """
        family = _description(*self.samples[0]).get("family") if self.samples else None
        return family if isinstance(family, str) else None

    @cached_property
    def groups(self) -> list[int]:
        """The number of samples in each shard, in order.

        Random access is fast if it stays in a few shards at a time.
        """
        return [len(list(samples)) for _, samples in groupby(self.samples, key=itemgetter(0))]


def _recognises(root: Path) -> bool:
    names = [root.name] if root.is_file() else (path.name for path in matching(root, "*.tar"))
    return any(_SHARD_NAME.fullmatch(name) for name in names)


def _find(location: str, split: str) -> Sequence[StereoFrame]:
    index = read_index(location)
    names = None if index is None else index.shards
    shards = list_shards(location) if names is None else [f"{location.rstrip('/')}/{name}" for name in names]
    samples: list[tuple[str, str]] = []
    for shard in sorted(set(shards)):
        name = _SHARD_NAME.fullmatch(shard.rpartition("/")[2])
        if name is None and names_shards(location):
            raise DatasetError(
                f"{shard}: is not named after its split and number as in train-000000.tar (train, val or test)"
            )
        if name and name[1] == split:
            keys = shard_index(local_copy(shard)) if names is None else names[name[0]]
            samples += ((shard, key) for key in keys)
    return ShardFrames(tuple(samples))


@dataclass(frozen=True)
class ShardSetIndex:
    """The content of `index.json`, which describes the shards beside it."""

    shards: dict[str, list[str]]
    """The keys of the samples by the shard's name."""
    files: tuple[FileEntry, ...]
    """Sizes and SHA-256 of the shards; empty if another tool wrote the index."""


def read_index(location: str) -> ShardSetIndex | None:
    """The index of a folder of shards, None if there is none. Raises DatasetError for an index that is damaged."""
    if names_shards(location):
        return None
    url = f"{location.rstrip('/')}/{INDEX_NAME}"
    try:
        with fsspec.open(url, "rb") as file:
            content = file.read()
    except FileNotFoundError:
        return None
    except (OSError, ValueError, ImportError) as error:
        raise DatasetError(f"{url}: cannot be read ({error})") from error
    try:
        data = json.loads(content)
        if OWN_DIGEST in data:
            check_seal(content, data[OWN_DIGEST])
        index = ShardSetIndex(data["shards"], file_entries(data.get("files", [])))
        if not all(
            _SHARD_NAME.fullmatch(name)
            and isinstance(keys, list)
            and all(isinstance(key, str) for key in keys)
            for name, keys in index.shards.items()
        ):
            raise InputError("a shard's name or its list of samples is not as it should be")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FormatError(f"{url}: is not an index of shards ({error})") from error
    return index


def scene_of(key: str) -> str:
    """The scene that a sample's key names.

    It is `<split>-<scene>` for keys of StereoForge and the folder for keys with one. Other samples are scenes of
    their own.
    """
    match = _KEY.fullmatch(key)
    return match[1] if match else key.rpartition("/")[0] or key


def _frame(shard: str, key: str) -> FileFrame:
    read = partial(_read, shard, key)
    return FileFrame(
        name=key,
        scene_name=scene_of(key),
        read_left=partial(read, "left.png", decode_png),
        read_right=partial(read, "right.png", decode_png),
        read_disparity_left=partial(read, "disparity_left.pfm", _decode_disparity),
        read_disparity_right=partial(read, "disparity_right.pfm", _decode_disparity),
        read_occlusion_left=partial(read, "occlusion_left.png", _decode_occlusion),
        read_object_index_left=partial(read, "object_index_left.png", decode_png),
        find_disparity_at_infinity=partial(_disparity_at_infinity, shard, key),
    )


def _disparity_at_infinity(shard: str, key: str) -> float:
    """cx_left - cx_right of a sample's description; 0 if it does not say them."""
    description = _description(shard, key)
    left, right = (description.get(name, 0.0) for name in ("cx_left", "cx_right"))
    if not (isinstance(left, int | float) and isinstance(right, int | float) and isfinite(left - right)):
        raise FormatError(
            f"{shard}: {key}.{META} does not describe its sample (cx_left or cx_right is no number)"
        )
    return float(left - right)


def _decode_occlusion(data: bytes, origin: str) -> NDArray[np.uint8]:
    return labels_of(decode_png(data, origin), origin)


def _decode_disparity(data: bytes, origin: str) -> NDArray[np.float32]:
    return first_channel(decode_pfm(data, origin), origin)


def _read(shard: str, key: str, member: str, decode: Any) -> Any:
    try:
        data = read_sample_member(shard, key, member)
    except KeyError as error:
        raise FormatError(f"{shard}: has no sample {key}") from error
    if data is None:
        raise FormatError(f"{shard}: its sample {key} has no {member}")
    digest = _digest(shard, key, member)
    if digest is not None and hashlib.sha256(data).hexdigest() != digest:
        raise FormatError(f"{shard}: {key}.{member} is damaged, its SHA-256 is not the one in {META}")
    return decode(data, f"{shard}: {key}.{member}")


def _digest(shard: str, key: str, member: str) -> str | None:
    """The SHA-256 of a sample's member if its description has one; other tools may write none."""
    digests = _description(shard, key).get("sha256", {})
    if not isinstance(digests, dict):
        raise FormatError(f"{shard}: {key}.{META} does not describe its sample (sha256 is no object)")
    return digests.get(member)


@lru_cache(maxsize=_DESCRIPTIONS_KEPT)
def _description(shard: str, key: str) -> dict[str, Any]:
    """A sample's description of itself; empty if it has no such member."""
    content = read_sample_member(shard, key, META)
    if content is None:
        return {}
    try:
        description = json.loads(content)
        if not isinstance(description, dict):
            raise TypeError("it is no object")
    except (ValueError, TypeError, RecursionError) as error:
        raise FormatError(f"{shard}: {key}.{META} does not describe its sample ({error})") from error
    return description


FORMATS = (SourceFormat("webdataset", "WebDataset shards", _recognises, _find, SPLITS, takes_patterns=True),)

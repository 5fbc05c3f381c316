"""Comparing every byte of exported shards with their index. No member is decoded."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed

import fsspec

from datagen.dataset.integrity import compare_open
from datagen.dataset.manifest import FileEntry
from datagen.errors import DatasetError
from datagen.sources.webdataset import INDEX_NAME, ShardSetIndex, read_index, scene_of
from datagen.verify.report import Problem, VerifyReport
from stereoforge_kit.files import LocalTree, Tree


def has_shards(tree: Tree) -> bool:
    """Whether a folder or URL has exported shards instead of a data set."""
    return tree.exists(INDEX_NAME)


def verify_shards(
    tree: Tree, progress: Callable[[int, int], None] | None = None, *, workers: int | None = None
) -> VerifyReport:
    """Compare every shard with its size and SHA-256 in the index, several at a time.

    Args:
        tree: The folder or URL of the shards.
        progress: Called after each shard with (shards done, shards in all).
        workers: Number of threads; None for one per core.

    Raises:
        DatasetError: For an index that is damaged, or has no sizes and SHA-256, as other tools may write it.
    """
    start = time.perf_counter()
    index = read_index(tree.name)
    if index is None or not index.files:
        raise DatasetError(
            f"{tree.name}/{INDEX_NAME}: has no sizes and SHA-256 of its shards to compare with"
        )
    found: list[Problem] = list(_strays(tree, index))
    size = 0
    with ThreadPoolExecutor(workers or len(os.sched_getaffinity(0))) as pool:
        results = [pool.submit(_check, tree, entry) for entry in index.files]
        for done, result in enumerate(as_completed(results), start=1):
            bytes_read, problem = result.result()
            size += bytes_read
            found += [problem] if problem else []
            if progress is not None:
                progress(done, len(results))
    keys = [key for keys in index.shards.values() for key in keys]
    return VerifyReport(
        root=tree.name,
        scenes=len(set(map(scene_of, keys))),
        frames=len(keys),
        files=len(index.files),
        bytes_read=size,
        seconds=time.perf_counter() - start,
        problems=tuple(sorted(found, key=lambda problem: problem.place)),
    )


def _check(tree: Tree, entry: FileEntry) -> tuple[int, Problem | None]:
    try:
        with _open(tree, entry.path) as file:
            size, problem = compare_open(file, entry)
    except OSError as error:
        return 0, Problem(entry.path, f"cannot be read: {error.strerror or error}")
    return size, Problem(entry.path, problem) if problem else None


def _open(tree: Tree, name: str) -> io.BufferedIOBase:
    if isinstance(tree, LocalTree):
        return (tree.root / name).open("rb")
    file: io.BufferedIOBase = fsspec.open(f"{tree.name}/{name}", "rb").open()
    return file


def _strays(tree: Tree, index: ShardSetIndex) -> Iterator[Problem]:
    listed = {entry.path for entry in index.files}
    for name in tree.files_in(""):
        if name.endswith(".tar") and name not in listed:
            yield Problem(name, f"is not in {INDEX_NAME}")
    for name in index.shards.keys() - listed:
        yield Problem(name, f"has samples in {INDEX_NAME} but no size and SHA-256")

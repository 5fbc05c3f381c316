"""Preparing user assets (meshes, textures, environments): untrusted files become clean arrays in a store.

Every file is parsed in a process of its own with limited memory and time, since a file can make parsers of old
formats loop, crash or allocate all memory. The result is a plain array file named by the original's SHA-256
(`scenes.user_assets.pool`).
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple
from zipfile import is_zipfile

import numpy as np
from numpy.typing import NDArray

from datagen.dataset.shards import cache_folder
from datagen.errors import DatasetError, MachineError
from datagen.executors import LocalExecutor, WorkerPolicy
from datagen.recipe.preparation.meshes import MESH_SUFFIXES, REMARK, UpAxis, is_y_up, prepare_mesh
from datagen.recipe.preparation.pictures import (
    ENVIRONMENT_SUFFIXES,
    TEXTURE_SUFFIXES,
    prepare_environment,
    prepare_texture,
)
from datagen.recipe.preparation.side_files import SideFiles
from scenes.user_assets.pool import Asset, AssetPool, spread_over_splits
from stereoforge_kit.files import replacing, temporary_folder, walk_files
from stereoforge_kit.messages import shortened
from stereoforge_kit.processes import Limits, available_memory_bytes

PREPARATION = 2
"""Number of what the preparers do: files that another version prepared are prepared anew."""
MAX_FILE_BYTES = 500 << 20
MESH_LIMITS = Limits(timeout_s=120.0, memory_bytes=4 << 30)
"""A mesh of 1.3 million triangles takes more than 1 GB to weld and decimate."""
PICTURE_LIMITS = Limits(timeout_s=60.0, memory_bytes=4 << 30)
"""An environment of 16384 x 8192 pixels takes 1.6 GB before it is made smaller."""


FILES_PER_WORKER = 2000
"""A process that prepares files is replaced after so many: to start one takes as long as a hundred small files."""

Preparer = Callable[[Path], dict[str, NDArray[np.generic]]]
ImportProgress = Callable[[str, int, int], None]
"""Told of a kind of files how many are done, and how many there are."""


@dataclass(frozen=True)
class ImportedAssets:
    """The assets imported from the user's folders."""

    pool: AssetPool
    skipped: tuple[str, ...]
    """One sentence for each file that is not usable."""
    remarks: tuple[str, ...] = ()
    """One sentence for each file that is used, but not as it is."""


def import_assets(
    store: Path,
    *,
    meshes: Path | None = None,
    textures: Path | None = None,
    environments: Path | None = None,
    up_axis: UpAxis = "auto",
    keep_materials: bool = True,
    known: AssetPool | None = None,
    progress: ImportProgress | None = None,
) -> ImportedAssets:
    """Prepare all usable files below the given folders into `store`, as many at a time as there are cores.

    What the store has is not prepared again, so an interrupted import goes on where it was, and a folder that has grown
    costs its new files. A mesh that is turned upright has another name in the store than the same file as it is, and so
    has one whose materials or pictures have changed. Meshes that share a picture are for one split.

    Args:
        store: The folder for the prepared files; made if need be. It may hold files of other imports too.
        meshes: A folder of OBJ, PLY, glTF, GLB and STL files, with what they name: lists of materials, pictures.
        textures: A folder of PNG, JPEG, TIFF, WebP and BMP files.
        environments: A folder of equirectangular panoramas, Radiance HDR, OpenEXR and those of `textures`.
        up_axis: Which axis of the meshes points up, "y" or "z"; "auto" for what is usual in their format (`Y_UP`).
        keep_materials: Whether meshes are to show their own textures: then those that share one are for one split.
        known: A pool whose files keep their splits, as a data set's that already shows some of them.
        progress: Called with how many files of a kind are done, how many there are, and the kind.

    Raises:
        DatasetError: For a folder that is missing or has no usable file of its kind.
        MachineError: If this machine or the calling script, not a file, stops the work.
    """
    store.mkdir(parents=True, exist_ok=True)
    skipped: list[str] = []
    remarks: list[str] = []
    kinds: list[tuple[Asset, ...]] = []
    sources: dict[str, tuple[str, ...]] = {}
    for kind, folder, suffixes, prepare, limits in (
        ("meshes", meshes, MESH_SUFFIXES, partial(prepare_mesh, up_axis=up_axis, root=meshes), MESH_LIMITS),
        ("textures", textures, TEXTURE_SUFFIXES, prepare_texture, PICTURE_LIMITS),
        ("environments", environments, ENVIRONMENT_SUFFIXES, prepare_environment, PICTURE_LIMITS),
    ):
        if folder is None:
            kinds.append(())
            continue
        report = None if progress is None else partial(progress, kind)
        work = _FolderImport(suffixes, prepare, limits, store, partial(_identity, up_axis, folder), report)
        names = work.run(folder, skipped, remarks)
        decided = {} if known is None else {asset.sha256: asset.split for asset in getattr(known, kind)}
        if kind == "meshes" and keep_materials:
            sources = {sha256: _picture_sources(store, sha256) for sha256 in names}
        elif kind == "textures":  # A picture that a mesh has too is for that mesh's split.
            decided = {
                source: mesh.split for mesh in kinds[0] for source in sources.get(mesh.sha256, ())
            } | decided
        kinds.append(spread_over_splits(names, decided, _sharing(sources) if kind == "meshes" else {}))
    pool = AssetPool(meshes=kinds[0], textures=kinds[1], environments=kinds[2])
    return ImportedAssets(pool, tuple(skipped), tuple(remarks))


@contextmanager
def prepared_assets_folder() -> Iterator[Path]:
    """A folder of prepared files that stays: in the cache folder, or a temporary one where that cannot be written."""
    folder = cache_folder() / f"assets-{PREPARATION}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        with temporary_folder() as temporary:
            yield temporary
    else:
        yield folder


def copy_prepared(pool: AssetPool, store: Path, target: Path) -> None:
    """Copy the prepared files of a pool from one store to another, each whole or not at all, unless they are there."""
    target.mkdir(parents=True, exist_ok=True)
    for asset in pool.files:
        name = f"{asset.sha256}.npz"
        if not is_zipfile(target / name):
            with replacing(target / name) as temporary:
                shutil.copyfile(store / name, temporary)


def _identity(up_axis: UpAxis, folder: Path, path: Path) -> bytes:
    """What tells a prepared file from another one of the same original."""
    if path.suffix.lower() not in MESH_SUFFIXES:
        return b""
    return (b"y up" if is_y_up(path, up_axis) else b"") + SideFiles(path, folder).digest()


def _picture_sources(store: Path, sha256: str) -> tuple[str, ...]:
    """The SHA-256 of each picture that a prepared mesh has."""
    with np.load(store / f"{sha256}.npz", allow_pickle=False) as arrays:
        return tuple(map(str, arrays["sources"])) if "sources" in arrays.files else ()


def _sharing(sources: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    """The group of each mesh that has pictures: those that share one, if only through others, are in one group."""
    parent: dict[str, str] = {}

    def root(name: str) -> str:
        while (above := parent.setdefault(name, name)) != name:
            parent[name] = parent.get(above, above)
            name = above
        return name

    for mesh, pictures in sources.items():
        for picture in pictures:
            first, second = sorted((root(mesh), root(picture)))
            parent[second] = first
    return {mesh: root(mesh) for mesh, pictures in sources.items() if pictures}


class _Outcome(NamedTuple):
    """Of preparing one file: why it cannot be used, or what was changed about it."""

    problem: str | None = None
    remark: str | None = None


@dataclass(frozen=True)
class _FolderImport:
    """How the files of one kind are found and prepared."""

    suffixes: tuple[str, ...]
    prepare: Preparer
    limits: Limits
    store: Path
    identity: Callable[[Path], bytes] = lambda _: b""
    report: Callable[[int, int], None] | None = None

    def run(self, folder: Path, skipped: list[str], remarks: list[str]) -> dict[str, str]:
        """The names of a folder's usable files, all in the store, by their SHA-256.

        Raises DatasetError if there is none, and MachineError.
        """
        if not folder.is_dir():
            raise DatasetError(f"{folder}: there is no such folder")
        originals = self._originals(folder, skipped)
        prepared = {path: self.store / f"{sha256}.npz" for sha256, path in originals.items()}
        remark_of = {path: _stored_remark(file) for path, file in prepared.items() if is_zipfile(file)}
        jobs = [(path, file) for path, file in prepared.items() if path not in remark_of]
        problem_of: dict[Path, str] = {}
        for done, (path, outcome) in enumerate(self._prepared(jobs), start=1):
            if outcome.problem is None:
                remark_of[path] = outcome.remark
            else:
                problem_of[path] = outcome.problem
            if self.report is not None:
                self.report(len(prepared) - len(jobs) + done, len(prepared))
        # In the files' order, since they are done in any.
        skipped += [f"{path}: {problem_of[path]}" for path in prepared if path in problem_of]
        if not remark_of:
            reason = f": {skipped[-1]}" if skipped else ""
            raise DatasetError(f"{folder}: has no usable file among {', '.join(self.suffixes)}{reason}")
        remarks += [f"{path}: {remark_of[path]}" for path in prepared if remark_of.get(path)]
        return {prepared[path].stem: path.relative_to(folder).as_posix() for path in remark_of}

    def _originals(self, folder: Path, skipped: list[str]) -> dict[str, Path]:
        """The files worth preparing by the SHA-256 that names them in the store; of equal ones the first."""
        originals: dict[str, Path] = {}
        for path in walk_files(folder):
            if path.suffix.lower() not in self.suffixes:
                continue
            if not path.is_file():
                skipped.append(f"{path}: is no file, or a link to none")
            elif (size := path.stat().st_size) > MAX_FILE_BYTES:
                skipped.append(f"{path}: is larger than {MAX_FILE_BYTES >> 20} MB")
            elif not size:
                skipped.append(f"{path}: is empty")
            else:
                with path.open("rb") as file:
                    digest = hashlib.file_digest(file, "sha256")
                digest.update(self.identity(path))
                originals.setdefault(digest.hexdigest(), path)
        return originals

    def _prepared(self, jobs: list[tuple[Path, Path]]) -> Iterator[tuple[Path, _Outcome]]:
        """The outcome of each file, in any order. Raises MachineError where no file is at fault."""
        available = available_memory_bytes()
        fitting = available // (self.limits.memory_bytes or available)
        workers = max(1, min(len(jobs), len(os.sched_getaffinity(0)), fitting))
        executor = LocalExecutor(
            ({},) * workers, WorkerPolicy(self.limits, attempts=1, jobs_per_worker=FILES_PER_WORKER)
        )
        with closing(executor.run(partial(_prepare_file, self.prepare), jobs)) as outcomes:
            for outcome in outcomes:
                failure = outcome.failure
                if failure is not None and failure.kind in ("environment", "disk_full"):
                    raise MachineError(f"importing stopped, no file is at fault: {failure.sentence}")
                if failure is not None:
                    yield outcome.job[0], _Outcome(f"cannot be read, {failure.sentence}")
                else:
                    yield outcome.job[0], outcome.result or _Outcome()


def _stored_remark(prepared: Path) -> str | None:
    with np.load(prepared, allow_pickle=False) as arrays:
        return str(arrays[REMARK]) if REMARK in arrays.files else None


def _prepare_file(prepare: Preparer, job: tuple[Path, Path]) -> _Outcome:
    """In the worker: prepare one file for the store, or say why not. Whatever a parser raises is the file's fault."""
    path, target = job
    try:
        arrays = prepare(path)
    except MemoryError:
        return _Outcome("needs too much memory")
    except KeyError as error:
        return _Outcome(f"cannot be read (it has no {error})")
    except Exception as error:
        return _Outcome(f"cannot be read ({shortened(str(error), 200) or type(error).__name__})")
    remark = arrays.get(REMARK)
    temporary = target.with_suffix(f".{os.getpid()}.tmp")
    with temporary.open("wb") as file:
        np.savez(file, **arrays)
    temporary.replace(target)
    return _Outcome(remark=None if remark is None else str(remark))

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
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple
from zipfile import is_zipfile

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray

from datagen.dataset.shards import cache_folder
from datagen.errors import DatasetError, MachineError
from datagen.executors import LocalExecutor, WorkerPolicy
from datagen.formats.picture import read_picture
from scenes.geometry.building import solid
from scenes.user_assets.pool import Asset, AssetPool, spread_over_splits
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import replacing, temporary_folder, walk_files
from stereoforge_kit.messages import shortened
from stereoforge_kit.processes import Limits, available_memory_bytes

MESH_SUFFIXES = (".obj", ".ply", ".glb", ".stl")
TEXTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp")
ENVIRONMENT_SUFFIXES = (".hdr", ".exr")
Y_UP = (".glb",)
"""glTF says that y points up; the other formats say nothing, and z does here."""
UpAxis = Literal["auto", "y", "z"]
REMARK = "remark"
"""What a preparer returns beside the arrays where it changed something that the user should know."""
PREPARATION = 1
"""Number of what the preparers do: files that another version prepared are prepared anew."""
MAX_FILE_BYTES = 500 << 20
MAX_TRIANGLES = 300_000
"""Meshes of more are decimated (Garland and Heckbert, "Surface simplification using quadric error metrics", 1997)."""
DRACO = b"KHR_draco_mesh_compression"
MAX_GLTF_HEADER_BYTES = 1 << 24
"""Of a GLB file's beginning, which names the extensions that it needs."""
MAX_SIDE_PX = 4096
"""Larger images are made smaller."""
MEAN_LUMINANCE = 0.5
"""Environments are scaled to this, so that they light a scene as the generator's own skies do."""
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
    known: AssetPool | None = None,
    progress: ImportProgress | None = None,
) -> ImportedAssets:
    """Prepare all usable files below the given folders into `store`, as many at a time as there are cores.

    What the store has is not prepared again, so an interrupted import goes on where it was, and a folder that has grown
    costs its new files. A mesh that is turned upright has another name in the store than the same file as it is.

    Args:
        store: The folder for the prepared files; made if need be. It may hold files of other imports too.
        meshes: A folder of OBJ, PLY, GLB and STL files.
        textures: A folder of PNG, JPEG, TIFF, WebP and BMP files.
        environments: A folder of equirectangular Radiance HDR and OpenEXR files.
        up_axis: Which axis of the meshes points up, "y" or "z"; "auto" for what is usual in their format (`Y_UP`).
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
    for kind, folder, suffixes, prepare, limits in (
        ("meshes", meshes, MESH_SUFFIXES, partial(prepare_mesh, up_axis=up_axis), MESH_LIMITS),
        ("textures", textures, TEXTURE_SUFFIXES, prepare_texture, PICTURE_LIMITS),
        ("environments", environments, ENVIRONMENT_SUFFIXES, prepare_environment, PICTURE_LIMITS),
    ):
        if folder is None:
            kinds.append(())
            continue
        report = None if progress is None else partial(progress, kind)
        work = _FolderImport(suffixes, prepare, limits, store, partial(_identity, up_axis), report)
        decided = () if known is None else getattr(known, kind)
        kinds.append(spread_over_splits(work.run(folder, skipped, remarks), decided))
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


def _identity(up_axis: UpAxis, path: Path) -> bytes:
    """What tells a prepared file from another one of the same original."""
    return b"y up" if path.suffix.lower() in MESH_SUFFIXES and is_y_up(path, up_axis) else b""


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


def prepare_mesh(path: Path, up_axis: UpAxis = "auto") -> dict[str, NDArray[np.generic]]:
    """A mesh's `vertices` (V, 3), z upwards, `triangles` (T, 3) and `corner_uv` (3 T, 2).

    With a remark if it is decimated to `MAX_TRIANGLES`.

    Raises ValueError for a mesh of no use, and whatever the parser raises.
    """
    options = {"skip_materials": True} if path.suffix.lower() == ".obj" else {}
    with path.open("rb") as file:  # From an open file no parser looks for others beside it.
        if path.suffix.lower() == ".glb" and DRACO in file.read(MAX_GLTF_HEADER_BYTES):
            raise InputError("it is compressed with Draco, which is not read here; export it without")
        file.seek(0)
        loaded = trimesh.load(file, file_type=path.suffix[1:].lower(), force="mesh", process=False, **options)
    vertices, triangles = np.asarray(loaded.vertices, np.float64), np.asarray(loaded.faces, np.int64)
    if is_y_up(path, up_axis):
        vertices = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)
    if len(triangles) < 4:
        raise InputError(f"it has {len(triangles)} triangles, too few for a thing")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError("its triangles name vertices that are not there")
    triangles = triangles[np.isfinite(vertices).all(axis=1)[triangles].all(axis=1)]
    used, triangles = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], triangles.reshape(-1, 3)
    if not len(triangles) or np.sort(np.ptp(vertices, axis=0))[1] == 0:
        raise InputError("it has no surface")
    prepared: dict[str, NDArray[np.generic]] = {}
    if (count := len(triangles)) > MAX_TRIANGLES:
        fewer = trimesh.Trimesh(vertices, triangles).simplify_quadric_decimation(face_count=MAX_TRIANGLES)
        vertices, triangles = np.asarray(fewer.vertices, np.float64), np.asarray(fewer.faces, np.int64)
        prepared[REMARK] = np.array(f"its {count:,} triangles are decimated to {len(triangles):,}")
    mesh = solid(vertices, triangles, smooth=True)
    if len(mesh.triangles) < 4:
        raise InputError("its triangles have no area")
    return prepared | {
        "vertices": mesh.vertices,
        "triangles": mesh.triangles,
        "corner_uv": mesh.corner_uv,
    }


def is_y_up(path: Path, up_axis: UpAxis) -> bool:
    """Whether y points up in a file, by what the user says or by its format."""
    return up_axis == "y" or (up_axis == "auto" and path.suffix.lower() in Y_UP)


def prepare_texture(path: Path) -> dict[str, NDArray[np.generic]]:
    """A texture's `image`, (H, W, 3) uint8 sRGB, as `datagen.formats.picture` reads it.

    Raises FormatError for a file of no use.
    """
    return {"image": _bounded(read_picture(path, longest_px=MAX_SIDE_PX))}


def prepare_environment(path: Path) -> dict[str, NDArray[np.generic]]:
    """An environment's `radiance`, (H, W, 3) float32 linear RGB; with a remark if some of it was infinite.

    Raises ValueError for a file of no use, and whatever the parser raises.
    """
    radiance = _read_exr(path) if path.suffix.lower() == ".exr" else _read_hdr(path)
    prepared: dict[str, NDArray[np.generic]] = {}
    if (infinite := np.isposinf(radiance)).any():
        # Half floats end at 65504, which a sun exceeds.
        brightest = max(float(radiance[np.isfinite(radiance)].max(initial=0)), 0.0)
        radiance = np.where(infinite, np.float32(brightest), radiance)
        prepared[REMARK] = np.array(
            f"its infinite values are taken for {brightest:g}, the brightest finite one"
        )
    radiance = np.nan_to_num(np.maximum(_bounded(radiance), 0), neginf=0.0)
    luminance = float(radiance.mean())
    if luminance <= 0:
        raise InputError("it is black")
    return prepared | {"radiance": (radiance * (MEAN_LUMINANCE / luminance)).astype(np.float32)}


def _read_hdr(path: Path) -> NDArray[np.float32]:
    image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 3 or image.dtype != np.float32:
        raise InputError("it is no Radiance HDR picture")
    return np.ascontiguousarray(image[..., 2::-1])


def _read_exr(path: Path) -> NDArray[np.float32]:
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        planes = [np.asarray(channels[name].pixels, np.float32) for name in "RGB"]
    return np.stack(planes, axis=-1)


def _bounded(image: NDArray[np.generic]) -> NDArray[np.generic]:
    """The image, made smaller if it is larger than `MAX_SIDE_PX`."""
    longest = max(image.shape[:2])
    if longest <= MAX_SIDE_PX:
        return image
    size = tuple(max(1, length * MAX_SIDE_PX // longest) for length in image.shape[1::-1])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))

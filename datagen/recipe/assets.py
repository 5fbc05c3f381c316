"""Preparing user assets (meshes, textures, environments): untrusted files become clean arrays in a store.

Every file is parsed in a process of its own with limited memory and time, since a file can make parsers of old
formats loop, crash or allocate all memory. The result is a plain array file named by the original's SHA-256
(`scenes.user_assets.pool`).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray

from datagen.dataset.layout import SPLITS
from datagen.errors import DatasetError
from datagen.executors import LocalExecutor, WorkerPolicy
from datagen.formats.limits import check_image_size
from datagen.formats.picture import read_picture
from scenes.geometry.building import solid
from scenes.user_assets.pool import Asset, AssetPool
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import walk_files
from stereoforge_kit.processes import Limits

ASSET_KINDS = ("meshes", "textures", "environments")
"""The fields of `AssetPool` that hold files, named as their flags are."""
MESH_SUFFIXES = (".obj", ".ply", ".glb", ".stl")
TEXTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp")
ENVIRONMENT_SUFFIXES = (".hdr", ".exr")
MAX_FILE_BYTES = 500 << 20
MAX_TRIANGLES = 300_000
MAX_SIDE_PX = 4096
"""Larger images are made smaller."""
MEAN_LUMINANCE = 0.5
"""Environments are scaled to this, so that they light a scene as the generator's own skies do."""
MESH_LIMITS = Limits(timeout_s=60.0, memory_bytes=1 << 30)
PICTURE_LIMITS = Limits(timeout_s=60.0, memory_bytes=4 << 30)
"""An environment of 16384 x 8192 pixels takes 1.6 GB before it is made smaller."""


@dataclass(frozen=True)
class ImportedAssets:
    """The assets imported from the user's folders."""

    pool: AssetPool
    skipped: tuple[str, ...]
    """One sentence for each file that is not usable."""


def import_assets(
    store: Path, *, meshes: Path | None = None, textures: Path | None = None, environments: Path | None = None
) -> ImportedAssets:
    """Prepare all usable files below the given folders into `store`.

    Args:
        store: The folder for the prepared files; made if need be.
        meshes: A folder of OBJ, PLY, GLB and STL files.
        textures: A folder of PNG, JPEG, TIFF, WebP and BMP files.
        environments: A folder of equirectangular Radiance HDR and OpenEXR files.

    Raises:
        DatasetError: For a folder that is missing or has no usable file of its kind.
    """
    store.mkdir(parents=True, exist_ok=True)
    skipped: list[str] = []
    kinds: list[tuple[Asset, ...]] = []
    for folder, suffixes, prepare, limits in (
        (meshes, MESH_SUFFIXES, prepare_mesh, MESH_LIMITS),
        (textures, TEXTURE_SUFFIXES, prepare_texture, PICTURE_LIMITS),
        (environments, ENVIRONMENT_SUFFIXES, prepare_environment, PICTURE_LIMITS),
    ):
        kinds.append(
            () if folder is None else _import_folder(folder, suffixes, prepare, limits, store, skipped)
        )
    return ImportedAssets(AssetPool(kinds[0], kinds[1], kinds[2]), tuple(skipped))


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


Preparer = Callable[[Path], dict[str, NDArray[np.generic]]]


def _import_folder(
    folder: Path,
    suffixes: tuple[str, ...],
    prepare: Preparer,
    limits: Limits,
    store: Path,
    skipped: list[str],
) -> tuple[Asset, ...]:
    if not folder.is_dir():
        raise DatasetError(f"{folder}: there is no such folder")
    paths = [path for path in walk_files(folder) if path.suffix.lower() in suffixes]
    originals: dict[str, Path] = {}
    for path in paths:
        if not path.is_file():
            skipped.append(f"{path}: is no file, or a link to none")
            continue
        if path.stat().st_size > MAX_FILE_BYTES:
            skipped.append(f"{path}: is larger than {MAX_FILE_BYTES >> 20} MB")
            continue
        with path.open("rb") as file:
            originals.setdefault(hashlib.file_digest(file, "sha256").hexdigest(), path)
    found: list[Asset] = []
    one_worker = LocalExecutor(({},), WorkerPolicy(limits, attempts=1))
    jobs = [(path, store / f"{sha256}.npz") for sha256, path in originals.items()]
    with closing(one_worker.run(partial(_prepare_file, prepare), jobs)) as outcomes:
        for outcome in outcomes:
            path, prepared = outcome.job
            problem = outcome.result
            if outcome.failure is not None:
                problem = f"cannot be read, {outcome.failure.sentence}"
            if problem is None:
                found.append(Asset(path.relative_to(folder).as_posix(), prepared.stem))
            else:
                skipped.append(f"{path}: {problem}")
    if not found:
        reason = f": {skipped[-1]}" if skipped else ""
        raise DatasetError(f"{folder}: has no usable file among {', '.join(suffixes)}{reason}")
    return tuple(sorted(found, key=lambda asset: asset.sha256))


def _prepare_file(prepare: Preparer, job: tuple[Path, Path]) -> str | None:
    """In the worker: prepare one file for the store, or say why not. Whatever a parser raises is the file's fault."""
    path, target = job
    try:
        arrays = prepare(path)
    except MemoryError:
        return "needs too much memory"
    except KeyError as error:
        return f"cannot be read (it has no {error})"
    except Exception as error:
        return f"cannot be read ({' '.join(str(error).split())[:200] or type(error).__name__})"
    temporary = target.with_suffix(f".{os.getpid()}.tmp")
    with temporary.open("wb") as file:
        np.savez(file, **arrays)
    temporary.replace(target)
    return None


def prepare_mesh(path: Path) -> dict[str, NDArray[np.generic]]:
    """A mesh's `vertices` (V, 3), `triangles` (T, 3) and `corner_uv` (3 T, 2).

    Raises ValueError for a mesh of no use, and whatever the parser raises.
    """
    options = {"skip_materials": True} if path.suffix.lower() == ".obj" else {}
    with path.open("rb") as file:  # From an open file no parser looks for others beside it.
        loaded = trimesh.load(file, file_type=path.suffix[1:].lower(), force="mesh", process=False, **options)
    vertices, triangles = np.asarray(loaded.vertices, np.float64), np.asarray(loaded.faces, np.int64)
    if len(triangles) < 4:
        raise InputError(f"it has {len(triangles)} triangles, too few for a thing")
    if len(triangles) > MAX_TRIANGLES:
        raise InputError(f"it has {len(triangles)} triangles, more than {MAX_TRIANGLES}")
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError("its triangles name vertices that are not there")
    triangles = triangles[np.isfinite(vertices).all(axis=1)[triangles].all(axis=1)]
    used, triangles = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], triangles.reshape(-1, 3)
    if not len(triangles) or np.sort(np.ptp(vertices, axis=0))[1] == 0:
        raise InputError("it has no surface")
    mesh = solid(vertices, triangles, smooth=True)
    if len(mesh.triangles) < 4:
        raise InputError("its triangles have no area")
    return {"vertices": mesh.vertices, "triangles": mesh.triangles, "corner_uv": mesh.corner_uv}


def prepare_texture(path: Path) -> dict[str, NDArray[np.generic]]:
    """A texture's `image`, (H, W, 3) uint8 sRGB, as `datagen.formats.picture` reads it.

    Raises FormatError for a file of no use.
    """
    return {"image": _bounded(read_picture(path))}


def prepare_environment(path: Path) -> dict[str, NDArray[np.generic]]:
    """An environment's `radiance`, (H, W, 3) float32 linear RGB.

    Raises ValueError for a file of no use, and whatever the parser raises.
    """
    radiance = _read_exr(path) if path.suffix.lower() == ".exr" else _read_hdr(path)
    radiance = np.nan_to_num(np.maximum(_bounded(radiance), 0), posinf=0.0)
    luminance = float(radiance.mean())
    if luminance <= 0:
        raise InputError("it is black")
    return {"radiance": (radiance * (MEAN_LUMINANCE / luminance)).astype(np.float32)}


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
    check_image_size(Path("it"), image.shape[1], image.shape[0], 3)
    longest = max(image.shape[:2])
    if longest <= MAX_SIDE_PX:
        return image
    size = tuple(max(1, length * MAX_SIDE_PX // longest) for length in image.shape[1::-1])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))

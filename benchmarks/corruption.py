"""Every reader of files that others may have made, an example for each, and damage."""

from __future__ import annotations

import hashlib
import json
import tarfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import trimesh

from datagen.dataset.manifest import FileEntry, SceneManifest, read_manifest, write_manifest
from datagen.dataset.samples import read_scene
from datagen.dataset.shards import shard_index
from datagen.formats import (
    read_camera_data,
    read_gradient,
    read_pfm,
    read_png,
    write_camera_data,
    write_gradient,
    write_pfm,
    write_png,
)
from datagen.recipe.assets import prepare_environment, prepare_mesh, prepare_texture
from datagen.recipe.recipe import Recipe, read_recipe, write_recipe
from scenes import FAMILIES, sample_scene, scene_to_json
from training.networks import DispNetConfig, DispNetCorr1D
from training.runs.weights import TrainingSummary, load_regressor, save_weights

FLYING_THINGS = FAMILIES["flying_things"]


def read_weights(path: Path) -> None:
    """Tensors whose description beside them vouches for whatever bytes there are."""
    description = json.loads((path.parent / "regressor.template.json").read_text())
    description["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    (path.parent / "regressor.json").write_text(json.dumps(description))
    load_regressor(path.parent)


def read_shard(path: Path) -> None:
    shard_index.__wrapped__(path)  # not the answer remembered from the time before


def read_asset(prepare: Callable[[Path], object], path: Path) -> None:
    """A user's own file, read as `datagen.recipe.assets` does: whatever its parser raises refuses it."""
    try:
        prepare(path)
    except Exception as error:
        raise ValueError(" ".join(str(error).split())) from error


read_mesh = partial(read_asset, prepare_mesh)
READERS: dict[str, Callable[[Path], object]] = {
    "pfm": read_pfm,
    "png": read_png,
    "exr": read_gradient,
    "camera data": read_camera_data,
    "manifest": read_manifest,
    "scene": read_scene,
    "recipe": read_recipe,
    "weights": read_weights,
    "tar": read_shard,
    "obj": read_mesh,
    "stl": read_mesh,
    "ply": read_mesh,
    "glb": read_mesh,
    "jpg": partial(read_asset, prepare_texture),
    "hdr": partial(read_asset, prepare_environment),
}


def make_examples(folder: Path) -> dict[str, Path]:
    """An intact file for every reader."""
    rng = np.random.default_rng(0)
    paths = {
        "pfm": folder / "a.pfm",
        "png": folder / "a.png",
        "exr": folder / "a.exr",
        "camera data": folder / "camera_data.txt",
        "manifest": folder / "manifest.json",
        "scene": folder / "scenes" / "TRAIN" / "A" / "0000.json",
        "recipe": folder / "recipe.yaml",
        "weights": folder / "run" / "regressor.safetensors",
        "tar": folder / "train-000000.tar",
        "obj": folder / "a.obj",
        "stl": folder / "a.stl",
        "ply": folder / "a.ply",
        "glb": folder / "a.glb",
        "jpg": folder / "a.jpg",
        "hdr": folder / "a.hdr",
    }
    write_pfm(paths["pfm"], rng.normal(size=(20, 30)))
    write_png(paths["png"], rng.integers(0, 255, (20, 30, 3), dtype=np.uint8))
    write_gradient(paths["exr"], rng.normal(size=(20, 30, 2)).astype(np.float32), rng.random((20, 30)) < 0.5)
    write_camera_data(paths["camera data"], {6: (np.eye(4), np.eye(4))})
    entry = FileEntry("a/b", 3, "a1" * 32)
    write_manifest(paths["manifest"], SceneManifest("f", "train", 3, "0" * 64, (entry,), {"x": 1.0}))
    config = FLYING_THINGS.config(flying_objects=(1, 1), background_objects=(1, 1))
    paths["scene"].parent.mkdir(parents=True)
    paths["scene"].write_text(scene_to_json(sample_scene(rng, "flying_things", config)))
    write_recipe(paths["recipe"], Recipe(config, {"train": 3}))
    _write_weights(paths["weights"])
    _write_shard(paths["tar"], paths["png"])
    box = trimesh.creation.icosphere(subdivisions=2)
    for kind in ("obj", "stl", "ply", "glb"):
        box.export(paths[kind])
    cv2.imwrite(str(paths["jpg"]), rng.integers(0, 255, (20, 30, 3), dtype=np.uint8))
    cv2.imwrite(str(paths["hdr"]), rng.uniform(0.1, 2.0, (16, 32, 3)).astype(np.float32))
    return paths


def _write_weights(path: Path) -> None:
    network = DispNetCorr1D(DispNetConfig(width=0.05, max_displacement=4))
    save_weights(path.parent, "regressor", network, TrainingSummary("tiny", 1, 0, (), 1))
    (path.parent / "regressor.json").rename(path.parent / "regressor.template.json")


def _write_shard(path: Path, member: Path) -> None:
    with tarfile.open(path, "w") as tar:
        for key in range(4):
            tar.add(member, f"train-0000-{key:04d}.left.png")


def damage(good: bytes, rng: np.random.Generator) -> bytes:
    """A bit flipped, an end cut off, bytes of the first hundred replaced, inserted, or made a huge number."""
    bad = bytearray(good)
    kind, at, early = (
        int(rng.integers(5)),
        int(rng.integers(len(good))),
        int(rng.integers(min(len(good), 100))),
    )
    if kind == 0:
        bad[at] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        del bad[at:]
    elif kind == 2:
        bad[early] = int(rng.integers(256))
    elif kind == 3:
        bad[at:at] = rng.bytes(int(rng.integers(1, 9)))
    else:
        bad[early : early + 8] = b"\xff" * 7 + b"\x7f" if rng.random() < 0.5 else b"99999999"
    return bytes(bad)

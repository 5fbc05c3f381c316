"""Hundreds of random damages a reader: an array of a sane size or one sentence, never anything else.

The EXR reader has its own such test, in a process of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from datagen.dataset.manifest import FileEntry, SceneManifest, read_manifest, write_manifest
from datagen.errors import DatasetError
from datagen.formats import (
    cameras_record,
    read_camera_data,
    read_cameras,
    read_depth,
    read_flow,
    read_mask,
    read_occlusion,
    read_pfm,
    read_png,
    write_camera_data,
    write_cameras,
    write_depth,
    write_flow,
    write_mask,
    write_occlusion,
    write_pfm,
    write_png,
)
from scenes.spec import Rig, Trajectory

RNG = np.random.default_rng(0)
WRITERS: dict[str, tuple[Callable[[Path], None], Callable[[Path], Any]]] = {
    "pfm": (lambda path: write_pfm(path, RNG.normal(size=(20, 30))), read_pfm),
    "pfm, colour": (lambda path: write_pfm(path, RNG.normal(size=(9, 7, 3))), read_pfm),
    "png": (lambda path: write_png(path, RNG.integers(0, 255, (20, 30, 3), dtype=np.uint8)), read_png),
    "png, 16 bits": (lambda path: write_png(path, RNG.integers(0, 9, (20, 30), dtype=np.uint16)), read_png),
    "occlusion": (
        lambda path: write_occlusion(path, RNG.integers(0, 3, (20, 30), dtype=np.uint8)),
        read_occlusion,
    ),
    "flow": (lambda path: write_flow(path, RNG.normal(size=(9, 7, 2)).astype(np.float32)), read_flow),
    "mask": (lambda path: write_mask(path, RNG.random((20, 30)) < 0.5), read_mask),
    "camera data": (
        lambda path: write_camera_data(path, {k: (np.eye(4), RNG.normal(size=(4, 4))) for k in (6, 7)}),
        read_camera_data,
    ),
    "cameras": (
        lambda path: write_cameras(
            path, cameras_record(Rig(96, 64, 90, 91, 48, 49, 30, 0.2).camera(Trajectory.static()), {6: 0.0})
        ),
        read_cameras,
    ),
    "depth": (lambda path: write_depth(path, RNG.uniform(1, 90, (9, 7))), read_depth),
    "manifest": (
        lambda path: write_manifest(
            path, SceneManifest("f", "train", 3, "0" * 64, (FileEntry("a/b", 3, "a1" * 32),), {"x": 1.0})
        ),
        read_manifest,
    ),
}
TRIALS = 600


def damage(good: bytes, rng: np.random.Generator) -> bytes:
    damaged = bytearray(good)
    kind, at = rng.integers(5), int(rng.integers(len(good)))
    if kind == 0:
        del damaged[at:]
    elif kind == 1:
        damaged[at] ^= 1 << int(rng.integers(8))
    elif kind == 2:
        damaged[at : at + 6] = rng.bytes(6)
    elif kind == 3:
        damaged[at:at] = rng.bytes(int(rng.integers(1, 9)))
    else:
        damaged[int(rng.integers(min(len(good), 40)))] = int(rng.integers(256))
    return bytes(damaged)


@pytest.mark.parametrize("name", WRITERS)
def test_random_damage(tmp_path: Path, name: str) -> None:
    write, read = WRITERS[name]
    good, path = tmp_path / "good", tmp_path / "damaged"
    write(good)
    read(good)
    content, rng = good.read_bytes(), np.random.default_rng(1)
    sentences: list[str] = []
    for _ in range(TRIALS):
        path.write_bytes(damage(content, rng))
        try:
            read(path)
        except DatasetError as error:
            sentences.append(str(error))
    assert len(sentences) > TRIALS // 4
    assert all(str(path) in sentence and "\n" not in sentence for sentence in sentences)

"""Manifests: exact round trips, digests by hashlib, and nothing that leaves the data set's folder."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from datagen.dataset.manifest import (
    FileEntry,
    SceneManifest,
    file_entry,
    read_manifest,
    seal,
    write_manifest,
)
from datagen.errors import DatasetError

DIGEST = "0123456789abcdef" * 4
EXAMPLE = SceneManifest(
    family="flying_things",
    split="train",
    scene=3,
    recipe_sha256=DIGEST,
    files=(FileEntry("disparity/TRAIN/A/0003/left/0006.pfm", 12, DIGEST), FileEntry("a", 0, DIGEST)),
    seconds={"render": 1.25},
    statistics={"objects": 12, "occluded": [0.1, 0.2]},
    versions={"blender": "4.5.15"},
)


def test_round_trip(tmp_path: Path) -> None:
    write_manifest(tmp_path / "m.json", EXAMPLE)
    assert read_manifest(tmp_path / "m.json") == EXAMPLE
    assert [path.name for path in tmp_path.iterdir()] == ["m.json"]


def test_entry_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "b" / "c.bin"
    path.parent.mkdir()
    content = bytes(range(256)) * 5000
    path.write_bytes(content)
    assert file_entry(tmp_path, path) == FileEntry(
        "b/c.bin", len(content), hashlib.sha256(content).hexdigest()
    )


@pytest.mark.parametrize(
    "path", ["/etc/passwd", "../x", "a/../../x", "a/..", "..", "", ".", "C:/x", "a\\..\\..\\x", "a\0b", "//x"]
)
def test_paths_that_leave_the_root(tmp_path: Path, path: str) -> None:
    with pytest.raises(DatasetError, match="must stay below"):
        FileEntry(path, 1, DIGEST)
    write_manifest(tmp_path / "m.json", EXAMPLE)
    data = json.loads((tmp_path / "m.json").read_text())
    data["files"][1]["path"] = path
    (tmp_path / "m.json").write_text(json.dumps(data))
    with pytest.raises(DatasetError, match=r"m\.json: .*must stay below"):
        read_manifest(tmp_path / "m.json")


@given(st.text(max_size=30))
def test_a_path_that_is_accepted_resolves_below_the_root(path: str) -> None:
    root = Path("/data/set")
    try:
        entry = FileEntry(path, 1, DIGEST)
    except DatasetError:
        return
    assert root in Path(f"{root}/{entry.path}").resolve().parents


@pytest.mark.parametrize(("size", "digest"), [(-1, DIGEST), (1, DIGEST[:-1]), (1, DIGEST.upper()), (1, "")])
def test_sizes_and_digests_that_cannot_be(size: int, digest: str) -> None:
    with pytest.raises(DatasetError, match="cannot be"):
        FileEntry("a", size, digest)


def damaged(**changes: Any) -> bytes:
    data = json.loads(json.dumps({**EXAMPLE.__dict__, "files": [vars(entry) for entry in EXAMPLE.files]}))
    return json.dumps({key: value for key, value in (data | changes).items() if value is not ...}).encode()


DAMAGED = {
    "empty": b"",
    "no json": b"{",
    "no text": b"\xff\xfe\x00",
    "a list": b"[]",
    "a number": b"3",
    "deep": b"[" * 100_000,
    "no files": damaged(files=...),
    "files no list": damaged(files={}),
    "a file no mapping": damaged(files=["a"]),
    "a file without digest": damaged(files=[{"path": "a", "size": 1}]),
    "a size that is text": damaged(files=[{"path": "a", "size": "1", "sha256": DIGEST}]),
    "a size that is true": damaged(files=[{"path": "a", "size": True, "sha256": DIGEST}]),
    "a field too many": damaged(more=1),
    "a field missing": damaged(seconds=...),
    "scene as text": damaged(scene="3"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_is_one_sentence_naming_the_file(tmp_path: Path, name: str) -> None:
    path = tmp_path / "m.json"
    path.write_bytes(DAMAGED[name])
    with pytest.raises(DatasetError) as caught:
        read_manifest(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_the_undamaged_form_of_those_is_read(tmp_path: Path) -> None:
    (tmp_path / "m.json").write_text(seal(json.loads(damaged(scene=4))))
    assert read_manifest(tmp_path / "m.json") == replace(EXAMPLE, scene=4)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"m\.json: cannot be read: No such file"):
        read_manifest(tmp_path / "m.json")


def test_every_flipped_bit_is_found(tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    write_manifest(path, EXAMPLE)
    good = path.read_bytes()
    for position in range(len(good)):
        flipped = bytearray(good)
        flipped[position] ^= 1 << position % 8
        path.write_bytes(flipped)
        with pytest.raises(DatasetError, match=r"m\.json: "):
            read_manifest(path)

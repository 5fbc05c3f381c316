"""Nothing that is read can run code, leave its folder, or take memory that it only declares."""

from __future__ import annotations

import ast
import json
import os
import struct
import tarfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from datagen.dataset import read_scene
from datagen.errors import DatasetError
from datagen.formats import read_gradient, read_pfm, read_png
from datagen.formats.picture import read_picture
from datagen.formats.png import read_png_size
from datagen.manifest import FileEntry, read_manifest
from datagen.recipe import read_recipe
from datagen.scene_check import Problem
from datagen.shards import read_sample_member, shard_index
from datagen.source import open_source
from training.errors import TrainingError
from training.weights import load_regressor
from workers import call_limited

PACKAGES = (
    "scenes",
    "datagen",
    "training",
    "refine",
    "matching",
    "viewing",
    "storage",
    "workers",
    "stereoforge",
)
FORBIDDEN_MODULES = {"pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
PIPE_TO_OWN_CHILD = "workers/process.py"
"""Tries whether an exception survives the pipe between a process and its own worker; reads no file."""
FORBIDDEN_CALLS = {"eval", "exec", "yaml.load", "yaml.unsafe_load", "yaml.full_load", "torch.load"}
ROOT = Path(__file__).parents[1]


def sources() -> Iterator[tuple[str, ast.AST]]:
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT).as_posix(), ast.parse(path.read_text())


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.split(".")[0]


def test_no_module_imports_what_can_run_code_when_it_reads() -> None:
    found = {name for name, tree in sources() if FORBIDDEN_MODULES & set(imported(tree))}
    assert found == {PIPE_TO_OWN_CHILD}


def test_no_module_calls_what_can_run_code_when_it_reads() -> None:
    found = [
        f"{name}:{node.lineno} {ast.unparse(node.func)}"
        for name, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) in FORBIDDEN_CALLS
    ]
    assert found == []


def test_numpy_is_never_told_to_read_pickles() -> None:
    found = [
        f"{name}:{node.lineno}"
        for name, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.keyword) and node.arg == "allow_pickle" and ast.unparse(node.value) != "False"
    ]
    assert found == []


def test_lightning_reads_checkpoints_as_weights_only() -> None:
    calls = [
        node
        for name, tree in sources()
        if name.startswith("training/")
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and any(keyword.arg == "ckpt_path" for keyword in node.keywords)
    ]
    assert calls
    for call in calls:
        assert any(
            keyword.arg == "weights_only" and ast.unparse(keyword.value) == "True"
            for keyword in call.keywords
        )


@pytest.mark.parametrize(
    "path", ["/etc/passwd", "../a", "a/../../b", "a\\..\\b", "c:/b", "", "a\0b", "a\nb", "\x1b[31ma"]
)
def test_a_manifest_names_nothing_outside_its_folder(path: str) -> None:
    with pytest.raises(DatasetError):
        FileEntry(path, 1, "0" * 64)


ALIASES = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{after}: &{after} [{', '.join([f'*{before}'] * 9)}]\n"
    for before, after in zip("abcdefghi", "bcdefghij", strict=True)
)


@pytest.mark.parametrize(
    "text",
    [
        "world: !!python/object/apply:os.system [echo hello]\n",
        "!!python/object/new:os.system [echo hello]\n",
        "[" * 5000,
        ALIASES + "world: *j\nscenes: *j\n",
        "world: {family: flying_things, width: " + "9" * 5000 + "}\nscenes: {train: 1}\n",
        "x" * (2 << 20),
    ],
)
def test_recipes_that_mean_harm(tmp_path: Path, text: str) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(text)
    with pytest.raises(DatasetError, match=r"recipe\.yaml") as refusal:
        call_limited(read_recipe, (path,), memory_bytes=1 << 30, timeout_s=5.0)
    assert len(str(refusal.value)) < 10_000


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"a":' * 50_000, "1e999", '{"family": ' + "9" * 5000 + "}", "\0"]
)
def test_scene_records_that_mean_harm(tmp_path: Path, text: str) -> None:
    path = tmp_path / "0000.json"
    path.write_text(text)
    with pytest.raises(DatasetError, match=r"0000\.json"):
        read_scene(path)


def write_weights(run: Path, network: dict[str, object], tensors: bytes) -> None:
    import hashlib

    run.mkdir()
    (run / "regressor.safetensors").write_bytes(tensors)
    description = {
        "format": 1,
        "task": "regressor",
        "sha256": hashlib.sha256(tensors).hexdigest(),
        "regressor_sha256": None,
        "network": network,
        "training": {},
    }
    (run / "regressor.json").write_text(json.dumps(description))


HEADER = json.dumps({"a": {"dtype": "F32", "shape": [2**40], "data_offsets": [0, 2**42]}}).encode()


@pytest.mark.parametrize(
    ("network", "tensors"),
    [
        ({"width": 1e5}, struct.pack("<Q", 2) + b"{}"),
        ({"max_displacement": 10**12}, struct.pack("<Q", 2) + b"{}"),
        ({}, struct.pack("<Q", 2**62)),
        ({}, struct.pack("<Q", len(HEADER)) + HEADER),
        ({}, b"\x80\x04\x95 a pickle, not tensors"),
        ({}, b""),
    ],
)
def test_weights_that_declare_more_than_they_hold(
    tmp_path: Path, network: dict[str, object], tensors: bytes
) -> None:
    write_weights(tmp_path / "run", network, tensors)
    with pytest.raises(TrainingError, match=r"regressor\.safetensors"):
        call_limited(load_regressor, (tmp_path / "run",), memory_bytes=1 << 30, timeout_s=20.0)


def tar_header(kind: bytes, size: bytes, content: bytes = b"") -> bytes:
    header = bytearray(tarfile.TarInfo("train-0000-0006.left.png").tobuf(tarfile.USTAR_FORMAT))
    header[124:136], header[156:157], header[148:156] = size, kind, b" " * 8
    header[148:156] = b"%06o\0 " % sum(header[:512])
    return bytes(header) + content


END_OF_TAR = bytes(10240)


@pytest.mark.parametrize(
    "content",
    [
        tar_header(b"0", b"\xff" * 12),  # a negative size
        tar_header(b"0", b"\x80" + b"\x7f" * 11),  # 2^87 bytes
        tar_header(b"x", b"77777777777\0"),  # 8 GiB of extended header
        tar_header(b"L", b"77777777777\0"),  # 8 GiB of name
        tar_header(b"L", b"00000000001\0", b"a".ljust(512, b"\0")) * 5000,  # a name of a name of a name
        tar_header(b"S", b"00000000000\0"),  # a file with holes
    ],
)
def test_shards_that_mean_harm(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "train-000000.tar"
    path.write_bytes(content + END_OF_TAR)
    with pytest.raises(DatasetError, match=r"train-000000\.tar") as refusal:
        call_limited(shard_index, (path,), memory_bytes=1 << 30, timeout_s=5.0)
    assert "\n" not in str(refusal.value)


def test_members_of_a_shard_are_never_files_elsewhere(tmp_path: Path) -> None:
    path = tmp_path / "train-000000.tar"
    with tarfile.open(path, "w") as tar:
        for name in ("../../up.left.png", "/etc/passwd.left.png"):
            tar.addfile(tarfile.TarInfo(name))
        for kind in (tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE, tarfile.FIFOTYPE):
            link = tarfile.TarInfo(f"link{kind.decode()}.left.png")
            link.type, link.linkname = kind, "/etc/passwd"
            tar.addfile(link)
    assert list(shard_index(path)) == ["up", "passwd"]  # Keys, not paths: nothing is unpacked.
    assert read_sample_member(str(path), "passwd", "left.png") == b""


@pytest.mark.parametrize("content", ["[" * 100_000, '{"shards": {"../../train-000000.tar": ["a"]}}'])
def test_indices_of_shards_that_mean_harm(tmp_path: Path, content: str) -> None:
    (tmp_path / "index.json").write_text(content)
    with pytest.raises(DatasetError, match=r"index\.json"):
        open_source(f"webdataset:{tmp_path}").frames("train")


@pytest.mark.parametrize(
    "read", [read_pfm, read_png, read_png_size, read_gradient, read_picture, read_manifest, read_recipe]
)
def test_what_is_no_regular_file_is_not_read(tmp_path: Path, read: Callable[[Path], object]) -> None:
    endless, pipe = tmp_path / "endless", tmp_path / "pipe"
    endless.symlink_to("/dev/zero")
    os.mkfifo(pipe)
    for path in (endless, pipe):
        with pytest.raises(DatasetError, match="no regular file"):
            read(path)


def test_a_manifest_that_carries_no_digest(tmp_path: Path) -> None:
    path = tmp_path / "0000.json"
    fields = {
        "family": "a",
        "split": "train",
        "scene": 1,
        "recipe_sha256": "",
        "files": [],
        "seconds": {},
        "statistics": {},
        "versions": {},
    }
    for digest in ("", None, "{", 7):
        path.write_text(json.dumps({**fields, "manifest_sha256": digest}) + " " * (16 << 20))
        with pytest.raises(DatasetError, match="does not carry its own SHA-256"):
            read_manifest(path)


def test_names_in_messages_keep_to_their_line() -> None:
    assert str(Problem("a\n\x1b[31mb", "is odd")) == "a\\n\\x1b[31mb: is odd"


@pytest.mark.parametrize("largest", [0, 65536, 99999])
def test_grey_maps_with_values_that_do_not_exist(tmp_path: Path, largest: int) -> None:
    path = tmp_path / "a.pgm"
    path.write_bytes(f"P5\n2 2\n{largest}\n".encode() + bytes(8))
    with pytest.raises(DatasetError, match="largest value"):
        read_picture(path)

"""Nothing that is read can run code, leave its folder, or take memory that it only declares."""

from __future__ import annotations

import ast
import json
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from datagen.dataset.manifest import FileEntry
from datagen.dataset.samples import read_scene
from datagen.errors import DatasetError
from datagen.recipe.recipe import read_recipe
from stereoforge_kit.processes import call_limited
from training.errors import TrainingError
from training.runs.weights import FORMAT, load_regressor

PACKAGES = ("scenes", "datagen", "training", "refine", "stereoforge_kit", "stereoforge")
FORBIDDEN_MODULES = {"pickle", "cPickle", "_pickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
PIPE_TO_OWN_CHILD = "stereoforge_kit/processes/process.py"
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


def weights_only(call: ast.Call) -> bool:
    """Whether torch, or Lightning for it, is told to build nothing but tensors and plain containers."""
    return any(
        keyword.arg == "weights_only" and ast.unparse(keyword.value) == "True" for keyword in call.keywords
    )


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
        if isinstance(node, ast.Call)
        and (
            any(keyword.arg == "ckpt_path" for keyword in node.keywords)
            or ast.unparse(node.func).endswith(".load_checkpoint")
        )
    ]
    assert calls
    assert all(map(weights_only, calls))


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
        "format": FORMAT,
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
        ({"name": "dispnet", "width": 1e5}, struct.pack("<Q", 2) + b"{}"),
        ({"name": "dispnet", "max_displacement": 10**12}, struct.pack("<Q", 2) + b"{}"),
        ({"name": "costvolume", "stem": 10**9}, struct.pack("<Q", 2) + b"{}"),
        ({"name": "dispnet"}, struct.pack("<Q", 2**62)),
        ({"name": "dispnet"}, struct.pack("<Q", len(HEADER)) + HEADER),
        ({"name": "dispnet"}, b"\x80\x04\x95 a pickle, not tensors"),
        ({"name": "dispnet"}, b""),
        ({"name": "os"}, struct.pack("<Q", 2) + b"{}"),
        ({}, struct.pack("<Q", 2) + b"{}"),
    ],
)
def test_weights_that_declare_more_than_they_hold(
    tmp_path: Path, network: dict[str, object], tensors: bytes
) -> None:
    write_weights(tmp_path / "run", network, tensors)
    with pytest.raises(TrainingError, match=r"regressor\.safetensors"):
        call_limited(load_regressor, (tmp_path / "run",), memory_bytes=1 << 30, timeout_s=20.0)

"""Files made to harm whoever reads them: each is refused in one sentence, before it costs anything."""

from __future__ import annotations

import json
import os
import tarfile
from collections.abc import Callable
from pathlib import Path

import pytest

from datagen.dataset.manifest import read_manifest
from datagen.dataset.shards import read_sample_member, shard_index
from datagen.errors import DatasetError
from datagen.formats import read_gradient, read_pfm, read_png
from datagen.formats.picture import read_picture
from datagen.formats.png import read_png_size
from datagen.recipe.recipe import read_recipe
from datagen.sources.registry import open_source
from datagen.verify.report import Problem
from stereoforge_kit.processes import call_limited


def tar_header(kind: bytes, size: bytes, content: bytes = b"") -> bytes:
    header = bytearray(tarfile.TarInfo("train-0000-0006.left.png").tobuf(tarfile.USTAR_FORMAT))
    header[124:136], header[156:157], header[148:156] = size, kind, b" " * 8
    header[148:156] = b"%06o\0 " % sum(header[:512])
    return bytes(header) + content


END_OF_TAR = bytes(10240)


HARMFUL_SHARDS = {
    "a negative size": tar_header(b"0", b"\xff" * 12),
    "2^87 bytes": tar_header(b"0", b"\x80" + b"\x7f" * 11),
    "8 GiB of extended header": tar_header(b"x", b"77777777777\0"),
    "8 GiB of name": tar_header(b"L", b"77777777777\0"),
    "a name of a name of a name": tar_header(b"L", b"00000000001\0", b"a".ljust(512, b"\0")) * 5000,
    "a file with holes": tar_header(b"S", b"00000000000\0"),
}


def refusals(folder: Path) -> dict[str, str]:
    """What reading each of the harmful shards says."""
    said = {}
    for number, (name, content) in enumerate(HARMFUL_SHARDS.items()):
        path = folder / f"train-{number:06d}.tar"
        path.write_bytes(content + END_OF_TAR)
        try:
            said[name] = str(shard_index(path))
        except DatasetError as error:
            said[name] = str(error).removeprefix(f"{path}: is ")
    return said


def test_shards_that_mean_harm(tmp_path: Path) -> None:
    said = call_limited(refusals, (tmp_path,), memory_bytes=1 << 30, timeout_s=60.0)
    odd = {
        name: sentence for name, sentence in said.items() if not sentence.startswith(("not an", "cut off"))
    }
    assert odd == {}
    assert not any("\n" in sentence for sentence in said.values())


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

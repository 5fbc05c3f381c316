"""The files that a mesh file names: lists of materials, pictures and buffers beside it.

A mesh comes from anyone, so what it names is read only if it lies in the folder that the user gave, or in the mesh's
own. An absolute path, as Windows programs write it, stands for a file of that name beside the mesh.
"""

from __future__ import annotations

import hashlib
import json
import mmap
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from datagen.formats.limits import read_bounded
from stereoforge_kit.errors import InputError, UserError
from stereoforge_kit.messages import shortened

MAX_LIST_BYTES = 1 << 26
"""Largest list of materials, and largest header of a glTF file, that is read."""
_MATERIAL_LISTS = re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]{1,1000})", re.MULTILINE)
_PICTURE_LINES = re.compile(rb"^[ \t]*map_Kd[ \t]+([^\r\n]{1,1000})", re.MULTILINE | re.IGNORECASE)
_OPTION_VALUES = {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}
"""How many values the options of a picture in a list of materials have at most; all others have one."""
_GLB_HEADER, _CHUNK_HEADER = 12, 8


@dataclass(frozen=True)
class SideFiles:
    """Finds the files that a mesh file names."""

    mesh: Path
    root: Path
    """The folder that the user gave, with the mesh in it."""

    def find(self, name: str, near: Path | None = None) -> Path | None:
        """The file of a name, relative to the folder of `near`, which is the mesh if None; None if there is none."""
        plain = name.strip().strip('"').replace("\\", "/")
        folders = [(near or self.mesh).parent, self.mesh.parent]
        for candidate in (plain, PurePosixPath(plain).name):
            for folder in folders:
                path = folder / candidate
                try:
                    place = path.resolve()
                    inside = any(
                        place.is_relative_to(home.resolve()) for home in (self.root, self.mesh.parent)
                    )
                    if inside and place.is_file():
                        return path
                except (OSError, ValueError, RuntimeError):  # Names that no file can have, links in circles.
                    continue
        return None

    def find_uri(self, uri: str) -> Path | None:
        """As `find`, of a glTF file's relative URI."""
        return self.find(unquote(uri))

    def material_lists(self) -> Iterator[tuple[str, Path | None]]:
        """Name and place of each list of materials that an OBJ file names."""
        with self.mesh.open("rb") as file:
            if not file.read(1):
                return
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                lines = [
                    match[1].decode("utf-8", "replace").strip() for match in _MATERIAL_LISTS.finditer(content)
                ]
        for line in dict.fromkeys(lines):
            whole = self.find(line)  # Names may have spaces, and a line may have several names.
            for name in [line] if whole or line.count(".mtl") < 2 else line.split():
                yield name, self.find(name)

    def named(self) -> Iterator[tuple[str, Path | None]]:
        """Name and place of every file that the mesh is made of beside its own. Nothing for a file that is damaged."""
        suffix = self.mesh.suffix.lower()
        if suffix == ".obj":
            for name, place in self.material_lists():
                yield name, place
                for picture in _pictures_in(place) if place else ():
                    yield picture, self.find(picture, place)
        elif suffix in (".gltf", ".glb"):
            try:
                header, _ = read_gltf(self.mesh)
                entries = [*header.get("buffers", ()), *header.get("images", ())]
                uris = [entry["uri"] for entry in entries if "uri" in entry]
            except (UserError, TypeError, AttributeError):
                return
            for uri in uris:
                if isinstance(uri, str) and not uri.startswith("data:"):
                    yield uri, self.find_uri(uri)

    def digest(self) -> bytes:
        """What tells these files from others of the same names; empty for a mesh that names none."""
        parts = []
        for name, place in self.named():
            parts.append(name.encode())
            if place is None:
                parts.append(b"missing")
                continue
            with place.open("rb") as file:
                parts.append(hashlib.file_digest(file, "sha256").digest())
        return b"\0".join(parts)


def _pictures_in(materials: Path) -> list[str]:
    try:
        text = read_bounded(materials, MAX_LIST_BYTES)
    except UserError:
        return []
    lines = (match[1].decode("utf-8", "replace") for match in _PICTURE_LINES.finditer(text))
    return [picture_name(line) for line in lines]


def picture_name(line: str) -> str:
    """The file's name in a line such as `-s 2 2 2 -clamp on wood floor.png` of a list of materials."""
    words = line.split()
    while words and words[0].lower() in (*_OPTION_VALUES, "-blendu", "-blendv", "-cc", "-clamp", "-texres", "-bm",
                                         "-boost", "-imfchan", "-type"):  # fmt: skip
        most = _OPTION_VALUES.get(words.pop(0).lower())
        if most is None:
            words = words[1:]
            continue
        while most and len(words) > 1 and _is_number(words[0]):
            words, most = words[1:], most - 1
    return " ".join(words)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_gltf(path: Path) -> tuple[dict[str, Any], bytes | None]:
    """The header of a glTF or GLB file, and the binary chunk of a GLB file that has one.

    Raises InputError for a file that is neither.
    """
    binary = None
    if path.suffix.lower() == ".glb":
        with path.open("rb") as file:
            start = file.read(_GLB_HEADER)
            if start[:4] != b"glTF" or start[4:8] != b"\2\0\0\0":
                raise InputError("it is no GLB file of version 2")
            kind, text = _chunk(file.read(_CHUNK_HEADER), file)
            if kind != b"JSON" or len(text) > MAX_LIST_BYTES:
                raise InputError("its first chunk is no header")
            kind, rest = _chunk(file.read(_CHUNK_HEADER), file)
            binary = rest if kind == b"BIN\0" else None
    else:
        text = read_bounded(path, MAX_LIST_BYTES)
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"its header is no JSON ({shortened(str(error), 80)})") from error
    if not isinstance(header, dict):
        raise InputError("its header is no glTF")
    return header, binary


def _chunk(head: bytes, file: Any) -> tuple[bytes, bytes]:
    """Kind and content of a GLB file's chunk; empty at the file's end."""
    if len(head) < _CHUNK_HEADER:
        return b"", b""
    length = int.from_bytes(head[:4], "little")
    content = file.read(length)
    if len(content) < length:
        raise InputError("it is cut off")
    return head[4:], content

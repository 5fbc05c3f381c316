"""A scene's manifest: all its files with their sizes and SHA-256. It is written last and makes the scene exist."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar

from datagen.errors import DatasetError
from datagen.formats.limits import MAX_JSON_BYTES, read_bounded
from stereoforge_kit.files import write_text
from stereoforge_kit.messages import listed

T = TypeVar("T")

_SHA256 = re.compile(r"[0-9a-f]{64}")
OWN_DIGEST = "manifest_sha256"
"""The key under which a sealed record has its own SHA-256."""
_NO_DIGEST = "0" * 64
_NO_DIGEST_AT_END = re.compile(rf'"{_NO_DIGEST}"\n\}}\n\Z')


@dataclass(frozen=True)
class FileEntry:
    """One file as it was when the scene was committed."""

    path: str
    """Relative to the data set's root, with forward slashes; never leaves the root."""
    size: int
    """Bytes."""
    sha256: str
    """64 lower-case hexadecimal digits."""

    def __post_init__(self) -> None:
        parts = PurePosixPath(self.path).parts
        if (
            not parts
            or self.path.startswith("/")
            or ".." in parts
            or re.search(r"[\\:\x00-\x1f\x7f]", self.path)
        ):
            raise DatasetError(f"a manifest's path must stay below the data set's folder, got {self.path!r}")
        if self.size < 0 or not _SHA256.fullmatch(self.sha256):
            raise DatasetError(f"{self.path}: {self.size} bytes with SHA-256 {self.sha256!r} cannot be")


@dataclass(frozen=True)
class SceneManifest:
    """What a committed scene consists of and how it was made."""

    family: str
    split: str
    scene: int
    recipe_sha256: str
    files: tuple[FileEntry, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    """Wall time of each step in seconds."""
    statistics: dict[str, Any] = field(default_factory=dict)
    """Numbers about the scene's frames."""
    versions: dict[str, str] = field(default_factory=dict)
    """Versions of the software that made the scene, by its name."""


def file_entry(root: Path, path: Path) -> FileEntry:
    """The entry of the file at `path`, which lies below `root`. Raises OSError if it cannot be read."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        size = file.tell()
    return FileEntry(path=path.relative_to(root).as_posix(), size=size, sha256=digest)


def write_manifest(path: Path, manifest: SceneManifest) -> None:
    """Write a scene's manifest, which commits the scene: all its files must be in place."""
    write_text(path, seal(asdict(manifest)))


def seal(record: dict[str, Any]) -> str:
    """A record as JSON text that ends with the text's own SHA-256, computed with zeros in its place."""
    text = json.dumps(record | {OWN_DIGEST: _NO_DIGEST}, indent=1) + "\n"
    digest = hashlib.sha256(text.encode()).hexdigest()
    return _NO_DIGEST_AT_END.sub(f'"{digest}"\n}}\n', text)


def read_manifest(path: Path) -> SceneManifest:
    """Read a scene's manifest. Raises DatasetError for a file that is missing, damaged or no manifest."""
    try:
        content = read_bounded(path, MAX_JSON_BYTES)
        data = json.loads(content)
        digest = data.pop(OWN_DIGEST, None)
        files = file_entries(data.pop("files"))
        manifest = _typed(SceneManifest, _MANIFEST_TYPES, data | {"files": files})
        check_seal(content, digest)
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}" if str(path) not in str(error) else str(error)) from error
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DatasetError(
            f"{path}: is not a scene's manifest, it is no JSON; verify --repair renders its scene again"
        ) from error
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise DatasetError(f"{path}: is not a scene's manifest ({error})") from error
    return manifest


def check_seal(content: bytes, digest: Any) -> None:
    """Raise DatasetError, without the file's name, if text that `seal` made has changed.

    digest: The SHA-256 that the text carries.
    """
    if not isinstance(digest, str) or not _SHA256.fullmatch(digest):
        raise DatasetError(f"does not carry its own SHA-256 but {str(digest)[:80]!r}")
    plain = content.replace(digest.encode(), _NO_DIGEST.encode())
    if hashlib.sha256(plain).hexdigest() != digest:
        raise DatasetError("is damaged, its SHA-256 is not the one it carries")


def file_entries(value: Any) -> tuple[FileEntry, ...]:
    """File entries from their parsed JSON. Raises TypeError, ValueError or DatasetError for anything else."""
    if not isinstance(value, list):
        raise TypeError("its files are not a list")
    return tuple(_typed(FileEntry, _FILE_TYPES, entry) for entry in value)


_FILE_TYPES: dict[str, type] = {"path": str, "size": int, "sha256": str}
_MANIFEST_TYPES: dict[str, type] = {
    "family": str,
    "split": str,
    "scene": int,
    "recipe_sha256": str,
    "files": tuple,
    "seconds": dict,
    "statistics": dict,
    "versions": dict,
}


def _typed(record: type[T], types: dict[str, type], data: dict[str, Any]) -> T:
    """Build `record` from exactly the named fields, none of them converted from another type."""
    if data.keys() != types.keys():
        raise TypeError(f"its fields are {listed([*data])}")
    for name, kind in types.items():
        if type(data[name]) is not kind:
            raise TypeError(f"{name} is {str(data[name])[:40]!r}, which is no {kind.__name__}")
    return record(**data)

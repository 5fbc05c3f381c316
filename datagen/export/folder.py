"""The folder of an export: a record says whose it is, so that no two exports mix.

The same export continues, another is refused or, where that is asked for, replaced once it is whole.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from typing import Any

from datagen.dataset.layout import FOLDERS
from datagen.dataset.samples import StereoDataset
from datagen.errors import DatasetError
from datagen.recipe.recipe import read_recipe
from datagen.sources.webdataset import INDEX_NAME
from stereoforge_kit.files import LocalTree, TemporaryFolders, Tree

RECORD = "export.json"
"""The name of the record in the export's folder."""
STAGING = ".export"
_OURS = re.compile(
    "|".join(
        [
            "training",
            "validation",
            "testing",
            "annotations",
            r"(train|val|test)-\d{6,}\.tar",
            re.escape(INDEX_NAME),
        ]
    )
    + rf"|recipe\.yaml|assets\.json|{'|'.join(FOLDERS)}"
)
"""What exports have at the top of their folder. Whatever else is there is somebody else's and stays."""


@dataclass(frozen=True)
class ExportRecord:
    """What was exported, and how."""

    format: str
    options: dict[str, Any]
    """What decides the files besides the data set: the render pass, and the format's own options."""
    recipe_sha256: str
    """`Recipe.settings_sha256` of the data set."""
    scenes: dict[str, list[int]]
    """The numbers of the scenes of each split."""
    whole: bool = False
    """False while it is being written."""
    mixed: bool = False
    """True while another export is being replaced."""

    def continues(self, other: ExportRecord) -> bool:
        """Whether this one writes over every file of another: the same, of a data set that may have grown."""
        same = ("format", "options", "recipe_sha256")
        return all(getattr(self, name) == getattr(other, name) for name in same) and all(
            set(numbers) <= set(self.scenes.get(split, ())) for split, numbers in other.scenes.items()
        )


def export_record(kind: str, sets: Sequence[StereoDataset], options: Mapping[str, Any]) -> ExportRecord:
    """The record of an export of some splits of one data set. Raises DatasetError for a recipe that is damaged."""
    scenes = {frames.split: sorted({sample.scene for sample in frames}) for frames in sets}
    settings = read_recipe(sets[0].layout.recipe).settings_sha256()
    return ExportRecord(kind, {**options, "render_pass": sets[0].render_pass}, settings, scenes)


@contextmanager
def export_folder(out: Tree, record: ExportRecord, *, overwrite: bool = False) -> Iterator[Tree]:
    """Where to write an export to. It is whole, and has its record, at the end of the `with` block.

    Args:
        out: The folder or URL that the user named.
        record: What is going to be written.
        overwrite: Replace another export, in a folder when the new one is whole; behind a URL, before it is written.

    Raises:
        DatasetError: If another export is there, or something that is none. Nothing has been touched then.
    """
    present = _present(out)
    if present is None or (record.continues(present) and not present.mixed and not overwrite):
        _write(out, record)
        yield out
        _write(out, replace(record, whole=True))
        return
    if not overwrite and not (present.mixed and record.continues(present)):
        raise DatasetError(
            f"{out.name}: has another export ({_described(present)}); give another folder, or --overwrite to replace it"
        )
    if isinstance(out, LocalTree):
        with TemporaryFolders(out.root / STAGING).new() as folder:
            staged = LocalTree(folder / "new")
            yield staged
            _write(out, replace(record, mixed=True))
            _remove_export(out)
            for name in staged.files_in(""):
                out.adopt(staged.root / name, name)
            _write(out, replace(record, whole=True))
        return
    _write(out, replace(record, mixed=True))
    _remove_export(out)
    yield out
    _write(out, replace(record, whole=True))


def _present(out: Tree) -> ExportRecord | None:
    """The record of the export that is there; None for a new or empty folder."""
    if not out.exists(RECORD):
        if any(not name.startswith(".") for name in out.files_in("")):
            raise DatasetError(
                f"{out.name} is neither empty nor an export with its {RECORD}; give a new or empty folder"
            )
        return None
    try:
        return ExportRecord(**json.loads(out.read(RECORD)))
    except (ValueError, TypeError, RecursionError) as error:
        raise DatasetError(
            f"{out.name}/{RECORD}: is no record of an export; give a new or empty folder"
        ) from error


def _described(record: ExportRecord) -> str:
    counts = ", ".join(f"{len(numbers)} {split}" for split, numbers in record.scenes.items())
    return f"{record.format}, {counts} scenes of the recipe {record.recipe_sha256[:8]}"[:120]


def _write(out: Tree, record: ExportRecord) -> None:
    out.write(RECORD, (json.dumps(asdict(record)) + "\n").encode())


def _remove_export(out: Tree) -> None:
    for name in out.files_in(""):
        if _OURS.fullmatch(name):
            out.remove(name)

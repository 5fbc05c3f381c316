"""The quarantine: scenes that could not be rendered, with what it takes to find out why.

    quarantine/TRAIN/A/0003.json    which scene, its record, the reason
    quarantine/TRAIN/A/0003.log     what Blender and the worker process printed

The quarantine is no part of the data. A scene leaves it when a later run renders the scene.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from datagen.dataset.layout import SPLITS, Layout, SceneKey
from datagen.errors import DatasetError
from datagen.executors import Failure
from datagen.recipe.recipe import Recipe
from scenes import scene_to_json
from stereoforge_kit.errors import InputError
from stereoforge_kit.files import Tree
from stereoforge_kit.processes import WorkerError, call_limited

_SAMPLING_TIMEOUT_S = 120.0
_SAMPLING_MEMORY_BYTES = 2 << 30


@dataclass(frozen=True)
class QuarantinedScene:
    """One scene that could not be rendered."""

    split: str
    scene: int
    kind: str
    """How the scene failed: `crash`, `killed`, `timeout`, `memory` or `exception`."""
    reason: str
    """One sentence."""
    attempts: int
    recipe_sha256: str
    record: dict[str, Any] | None
    """The Scene record; None if the scene could not be sampled."""

    @property
    def name(self) -> str:
        """Split and number, for example `train/0003`."""
        return f"{self.split}/{self.scene:04d}"


def put_in_quarantine(
    tree: Tree, scratch: Path, recipe: Recipe, split: str, scene: int, failure: Failure, attempts: int
) -> QuarantinedScene:
    """Record that a scene could not be rendered, and why.

    The files are written to `scratch` first, so that a killed run leaves no half of a file.
    """
    entry = QuarantinedScene(
        split=split,
        scene=scene,
        kind=failure.kind,
        reason=failure.sentence,
        attempts=attempts,
        recipe_sha256=recipe.settings_sha256(),
        record=_sample_safely(recipe, split, scene),
    )
    text = json.dumps(asdict(entry), indent=1) + "\n"
    for name, data in ((log_name(split, scene), failure.output), (_entry_name(split, scene), text)):
        staged = scratch / f"quarantined{Path(name).suffix}"
        staged.write_text(data, encoding="utf-8")
        tree.adopt(staged, name)
    return entry


def release(tree: Tree, split: str, scene: int) -> None:
    """Take a scene out of the quarantine if it is there."""
    tree.remove(_entry_name(split, scene))
    tree.remove(log_name(split, scene))


def quarantined_scenes(tree: Tree) -> list[SceneKey]:
    """(split, number) of every scene in quarantine, in order."""
    found = []
    for split in SPLITS:
        names = tree.files_in(_entry_name(split, 0).rpartition("/")[0])
        found += [(split, int(name[:-5])) for name in names if name.endswith(".json") and name[:-5].isdigit()]
    return sorted(found, key=lambda item: (SPLITS.index(item[0]), item[1]))


def read_quarantined(tree: Tree, split: str, scene: int) -> QuarantinedScene:
    """Read the entry of a scene in quarantine. Raises DatasetError for an entry that is missing or damaged."""
    name = _entry_name(split, scene)
    try:
        entry = QuarantinedScene(**json.loads(tree.read(name)))
        if (entry.split, entry.scene) != (split, scene):
            raise InputError("it is another scene's")
        return entry
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise DatasetError(f"{tree.name}/{name}: is not an entry of the quarantine ({error})") from error


def log_name(split: str, scene: int) -> str:
    """The path of a scene's log below the data set's root."""
    return _entry_name(split, scene).removesuffix(".json") + ".log"


def _entry_name(split: str, scene: int) -> str:
    return f"quarantine/{Layout(Path()).manifest(split, scene).as_posix().removeprefix('manifest/')}"


def _sample_safely(recipe: Recipe, split: str, scene: int) -> dict[str, Any] | None:
    """The Scene record, sampled in a process of its own, where a crash does no harm; None if that fails."""
    try:
        record: dict[str, Any] = call_limited(
            _sample_record,
            (recipe, split, scene),
            memory_bytes=_SAMPLING_MEMORY_BYTES,
            timeout_s=_SAMPLING_TIMEOUT_S,
        )
    except (WorkerError, ArithmeticError, LookupError, ValueError, TypeError, RuntimeError):
        return None
    return record


def _sample_record(recipe: Recipe, split: str, scene: int) -> dict[str, Any]:
    record: dict[str, Any] = json.loads(scene_to_json(recipe.sample(split, scene)))
    return record

"""A scene is swapped whole: whatever stops that, whoever clears the staging area finishes it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from datagen.dataset.layout import Layout
from datagen.dataset.manifest import SceneManifest, file_entry, write_manifest
from datagen.rendering.staging import STAGING_FOLDER, commit, manifest_digest, staging_area
from stereoforge_kit.files import LocalTree

KINDS = ("frames_cleanpass", "disparity", "occlusion", "camera_data")


class KilledError(Exception):
    pass


def write_scene(root: Path, content: str) -> None:
    layout = Layout(root)
    paths = [layout.file(kind, "train", 0, "left", 6) for kind in KINDS[:3]]
    paths += [layout.file("camera_data", "train", 0), layout.scene_record("train", 0)]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("the same" if "occlusion" in path.parts else content)
    entries = tuple(file_entry(root, path) for path in sorted(paths))
    write_manifest(layout.manifest("train", 0), SceneManifest("family", "train", 0, content, entries))


def content(root: Path) -> dict[str, str]:
    found = (path for path in root.rglob("*") if path.is_file() and STAGING_FOLDER not in path.parts)
    return {path.relative_to(root).as_posix(): path.read_text() for path in found}


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("moves", range(7))
def test_a_swap_killed_after_any_move_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moves: int, there: bool
) -> None:
    root, tree = tmp_path / "set", LocalTree(tmp_path / "set")
    write_scene(tmp_path / "new", "new")
    if there:
        write_scene(root, "old")
    else:
        root.mkdir()
    before, after, left = content(root), content(tmp_path / "new"), moves
    real = LocalTree.adopt

    def adopt(self: LocalTree, source: Path, name: str) -> None:
        nonlocal left
        if left == 0:
            raise KilledError
        left -= 1
        real(self, source, name)

    monkeypatch.setattr(LocalTree, "adopt", adopt)

    def swap() -> None:
        with staging_area(tree) as area:
            with area.scene_folder("train", 0) as staged:
                write_scene(staged, "new")
                commit(tree, staged, "train", 0, manifest_digest(tree, "train", 0))
            raise KilledError

    with pytest.raises(KilledError):
        swap()
    there_now = content(root)
    assert all(there_now[name] in (text, after[name]) for name, text in before.items())
    monkeypatch.undo()
    with staging_area(tree):
        pass
    assert content(root) == after
    assert not (root / STAGING_FOLDER).exists()


def test_a_file_with_the_same_bytes_is_not_touched(tmp_path: Path) -> None:
    root, tree = tmp_path / "set", LocalTree(tmp_path / "set")
    write_scene(root, "old")
    same = Layout(root).file("occlusion", "train", 0, "left", 6)
    inode = same.stat().st_ino
    with staging_area(tree) as area, area.scene_folder("train", 0) as staged:
        write_scene(staged, "new")
        commit(tree, staged, "train", 0, manifest_digest(tree, "train", 0))
    assert same.stat().st_ino == inode
    assert Layout(root).file("disparity", "train", 0, "left", 6).read_text() == "new"


def test_the_slower_of_two_attempts_changes_nothing(tmp_path: Path) -> None:
    root, tree = tmp_path / "set", LocalTree(tmp_path / "set")
    write_scene(root, "old")
    replaces = manifest_digest(tree, "train", 0)
    with staging_area(tree) as area:
        for text in ("first", "second"):
            with area.scene_folder("train", 0) as staged:
                write_scene(staged, text)
                commit(tree, staged, "train", 0, replaces)
    assert Layout(root).file("disparity", "train", 0, "left", 6).read_text() == "first"


@pytest.mark.parametrize("damaged", ["commit.json", "scene/manifest/TRAIN/A/0000.json"])
def test_a_record_that_a_power_cut_emptied_stops_no_run(tmp_path: Path, damaged: str) -> None:
    root, tree = tmp_path / "set", LocalTree(tmp_path / "set")
    write_scene(root, "old")
    before = content(root)
    attempt = root / STAGING_FOLDER / "run" / "train-0-x"
    write_scene(attempt / "scene", "new")
    digest = manifest_digest(tree, "train", 0)
    (attempt / "commit.json").write_text(json.dumps({"split": "train", "scene": 0, "replaces": digest}))
    (attempt / damaged).write_text("")
    with staging_area(tree):
        pass
    assert not (root / STAGING_FOLDER).exists()
    assert content(root).keys() == before.keys()
    assert Layout(root).manifest("train", 0).read_text() == before["manifest/TRAIN/A/0000.json"]

"""One walk for all folders of files: links, circles, order and droppings."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereoforge_kit.errors import InputError
from stereoforge_kit.files import LocalTree, is_data, matching, walk_files

DROPPINGS = ("._a.png", ".DS_Store", "Thumbs.db", "desktop.ini", ".git/a.png", "__MACOSX/a.png")


def fill(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")
    return folder


def names(root: Path) -> list[str]:
    return [path.relative_to(root).as_posix() for path in walk_files(root)]


def test_links_are_followed_in_order(tmp_path: Path) -> None:
    elsewhere = fill(tmp_path / "elsewhere", "x/2.png", "x/1.png", "file.png")
    root = fill(tmp_path / "root", "b/3.png", "a.png")
    (root / "c").symlink_to(elsewhere / "x")
    (root / "aa").symlink_to(elsewhere / "x")
    (root / "d.png").symlink_to(elsewhere / "file.png")
    assert names(root) == ["a.png", "aa/1.png", "aa/2.png", "b/3.png", "c/1.png", "c/2.png", "d.png"]


def test_circles_end(tmp_path: Path) -> None:
    root = fill(tmp_path / "root", "a/1.png", "b/2.png")
    (root / "a/self").symlink_to(root / "a")
    (root / "a/up").symlink_to(tmp_path)
    (root / "a/beside").symlink_to(root / "b")
    (root / "b/beside").symlink_to(root / "a")
    assert names(root) == ["a/1.png", "a/beside/2.png", "b/2.png", "b/beside/1.png"]


def test_a_link_to_nothing_is_listed_and_a_missing_folder_is_empty(tmp_path: Path) -> None:
    (tmp_path / "gone.png").symlink_to(tmp_path / "nowhere")
    assert names(tmp_path) == ["gone.png"]
    assert walk_files(tmp_path / "nowhere") == []


def test_a_folder_that_cannot_be_listed_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("os.scandir", refuse)
    with pytest.raises(InputError, match=r"cannot be listed: Permission denied"):
        walk_files(tmp_path)


def test_droppings_are_no_data(tmp_path: Path) -> None:
    root = fill(tmp_path / ".hidden/root", "a.png", "b/a.png", *DROPPINGS, *(f"b/{d}" for d in DROPPINGS))
    assert names(root) == ["a.png", "b/a.png"]
    assert [path.name for path in matching(root, "*.png")] == ["a.png"]
    assert matching(root, ("*/*.png", "*.png")) == [root / "b/a.png", root / "a.png"]
    assert LocalTree(root).files_in("") == ["a.png", "b"]
    assert LocalTree(root).files_below("b") == ["b/a.png"]
    assert is_data("./a.png")

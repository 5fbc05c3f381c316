"""Two exports never mix, and no command writes into what it reads."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from datagen.dataset.layout import Layout
from stereoforge.bundled_weights import BUNDLED_WEIGHTS
from stereoforge.cli import main
from stereoforge_kit.files import LocalTree, is_within
from tests.datagen.analytic_world import write_dataset


@pytest.fixture(scope="module")
def other_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A smaller data set, of another recipe than the analytic one; not to be changed."""
    root = tmp_path_factory.mktemp("other") / "set"
    write_dataset(root, {"train": 1})
    recipe = root / "recipe.yaml"
    text = recipe.read_text().replace("seed: 0", "seed: 9")
    assert text != recipe.read_text()
    recipe.write_text(text)
    for manifest in root.glob("manifest/*/*/*.json"):
        reseal(manifest, root)
    return root


def reseal(path: Path, root: Path) -> None:
    from dataclasses import replace

    from datagen.dataset.manifest import read_manifest, write_manifest
    from datagen.recipe.recipe import read_recipe

    settings = read_recipe(root / "recipe.yaml").settings_sha256()
    write_manifest(path, replace(read_manifest(path), recipe_sha256=settings))


def run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str]:
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    return int(end.value.code or 0), capsys.readouterr().err


def content(root: Path) -> dict[str, bytes]:
    return {
        path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*") if path.is_file()
    }


@pytest.mark.parametrize("kind", ["kitti", "sceneflow", "webdataset"])
def test_another_export_is_refused_or_replaced_as_a_whole(
    analytic_dataset: Path, other_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    words = ("--format", kind, "--frames-per-shard", "1")
    out = tmp_path / "out"
    assert run(capsys, "export", analytic_dataset, *words, "--out", out)[0] == 0
    first = content(out)
    (out / "notes.txt").write_text("mine")
    code, said = run(capsys, "export", other_dataset, *words, "--out", out)
    assert code == 1
    assert "has another export" in said
    assert content(out) == first | {"notes.txt": b"mine"}
    assert run(capsys, "export", other_dataset, *words, "--out", out, "--overwrite")[0] == 0
    assert run(capsys, "export", other_dataset, *words, "--out", tmp_path / "fresh")[0] == 0
    assert content(out) == content(tmp_path / "fresh") | {"notes.txt": b"mine"}


def test_the_same_export_continues_and_other_options_are_another(
    analytic_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("export", analytic_dataset, "--format", "webdataset", "--out", tmp_path / "out")
    assert run(capsys, *words, "--frames-per-shard", "1")[0] == 0
    first = content(tmp_path / "out")
    (tmp_path / "out/train-000001.tar").unlink()  # as if it had been interrupted
    assert run(capsys, *words, "--frames-per-shard", "1")[0] == 0
    assert content(tmp_path / "out") == first
    code, said = run(capsys, *words, "--frames-per-shard", "2")
    assert code == 1
    assert "has another export" in said
    assert content(tmp_path / "out") == first


def test_an_export_that_fails_leaves_the_one_that_it_was_to_replace(
    analytic_dataset: Path, other_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, damaged = tmp_path / "out", tmp_path / "damaged"
    shutil.copytree(other_dataset, damaged)
    Layout(damaged).file("disparity", "train", 0, "left", 7).write_bytes(b"Pf\n")
    assert run(capsys, "export", analytic_dataset, "--format", "kitti", "--out", out)[0] == 0
    first = content(out)
    assert run(capsys, "export", damaged, "--format", "kitti", "--out", out, "--overwrite")[0] == 1
    assert content(out) == first


def test_a_replacement_that_is_killed_is_done_again(
    analytic_dataset: Path,
    other_dataset: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "out"
    assert run(capsys, "export", analytic_dataset, "--format", "kitti", "--out", out)[0] == 0
    words = ("export", other_dataset, "--format", "kitti", "--out", out)
    with monkeypatch.context() as patch:
        patch.setattr(LocalTree, "remove", lambda *_: (_ for _ in ()).throw(OSError(5, "the plug is pulled")))
        assert run(capsys, *words, "--overwrite")[0] == 1
    assert run(capsys, *words)[0] == 0
    assert run(capsys, *words[:-1], tmp_path / "fresh")[0] == 0
    assert content(out) == content(tmp_path / "fresh")


def test_a_folder_with_something_else_is_refused(
    analytic_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "holiday.jpg").write_bytes(b"mine")
    for flags in ((), ("--overwrite",)):
        code, said = run(capsys, "export", analytic_dataset, "--format", "kitti", "--out", tmp_path, *flags)
        assert code == 1
        assert "neither empty nor an export" in said
    assert content(tmp_path) == {"holiday.jpg": b"mine"}


def spellings(folder: Path, tmp_path: Path) -> list[str]:
    """Names of a folder, and of one in it."""
    link = tmp_path / "link"
    if not link.exists():
        link.symlink_to(folder)
    (folder / "empty").mkdir(exist_ok=True)
    return [
        str(folder),
        f"{folder}/",
        f"{folder}/empty/..",
        str(link),
        f"{link}/new",
        f"/{folder}",
        f"file://{folder}",
        f"{folder}/x/y",
    ]


def test_no_command_writes_into_what_it_reads(
    own_dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    names = spellings(own_dataset, tmp_path)
    before = content(tmp_path)
    monkeypatch.chdir(tmp_path)
    for out in (*names, "set", "./set/../set"):
        commands: list[tuple[str, ...]] = [("export", "set", "--format", "kitti", "--out", out)]
        if "://" not in out:
            commands += [
                ("train", "regressor", "--data", "native:set:2", "--out", out, "--preset", "tiny"),
                ("evaluate", "set#0-1", "--out", out),
                ("evaluate", "set", "--out", "report", "--submission", out),
                ("tune", "set", "--weights", "run", "--out", f"{out}/parameters.json"),
                ("view", "set", "--out", f"{out}/gallery.html"),
                ("view", "other", "--compare", "set", "--out", f"{out}/gallery.html"),
                ("study", "--train", "set", "--test", "set", "--out", out),
                ("train", "regressor", "--data", "other", "--init", "set", "--out", out),
                ("export-model", "set", "--out", out),
            ]
        for words in commands:
            code, said = run(capsys, *words)
            assert code == 2, (words, said)
            assert "which is only read" in said, (words, said)
            assert len(said) <= 300 + len("stereoforge: ")
    code, said = run(capsys, "demo", "--out", str(BUNDLED_WEIGHTS / "demo"))
    assert code == 2, said
    assert content(tmp_path) == before


def test_render_and_refine_write_elsewhere_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    code, said = run(capsys, "render", "--textures", pictures, "--out", pictures / "set")
    assert (code, "which is only read" in said) == (2, True)
    given = tmp_path / "disparity.pfm"
    given.write_bytes(b"mine")
    code, said = run(capsys, "refine", "l.png", "r.png", "--disparity", given, "--out", f"{tmp_path}/x/..")
    assert (code, "which is only read" in said) == (2, True)
    assert given.read_bytes() == b"mine"


def test_places_that_only_look_alike(tmp_path: Path) -> None:
    assert not is_within(tmp_path / "set2", tmp_path / "set")
    assert not is_within(tmp_path, tmp_path / "set")
    assert is_within(tmp_path, "/")
    assert is_within("s3://bucket/a//b/", "s3://bucket/a/b")
    assert is_within("s3://bucket/a/b/c", "s3://bucket/a/b")
    assert not is_within("s3://bucket/a/bc", "s3://bucket/a/b")

"""Data sets behind URLs: a real S3 server on this machine, and fsspec's file system in memory."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fsspec
import pytest
import s3fs
from moto.server import ThreadedMotoServer

from datagen import DatasetError, StereoDataset, render_dataset
from datagen.dataset.layout import Layout
from datagen.dataset.shards import CACHE_VARIABLE
from datagen.executors import Failure, Outcome
from datagen.executors.base import Outcomes
from datagen.verify.dataset_check import verify_dataset
from stereoforge.cli import main
from stereoforge_kit.files import Tree, open_tree
from tests.datagen.analytic_world import vouch
from tests.datagen.sabotage import ONE_WORKER, RECIPE, Sabotage, hashes, without

SETTINGS = {
    "AWS_ACCESS_KEY_ID": "testing",
    "AWS_SECRET_ACCESS_KEY": "testing",
    "AWS_DEFAULT_REGION": "us-east-1",
}


@pytest.fixture(scope="module")
def bucket(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The URL of an empty bucket; workers find the server by the environment, as they would a real one."""
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    settings = {
        **SETTINGS,
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        CACHE_VARIABLE: str(tmp_path_factory.mktemp("cache")),
    }
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    s3fs.S3FileSystem.clear_instance_cache()
    s3fs.S3FileSystem().mkdir("stereo")
    yield "s3://stereo"
    server.stop()
    s3fs.S3FileSystem.clear_instance_cache()
    for name, value in before.items():
        if value is None:
            del os.environ[name]
        else:
            os.environ[name] = value


def upload(source: Path, url: str) -> None:
    open_tree(url).adopt(source, "")


def download(url: str, folder: Path) -> Path:
    filesystem, path = fsspec.core.url_to_fs(url, use_listings_cache=False)
    filesystem.get(path, str(folder), recursive=True)
    return folder


@pytest.mark.slow
def test_rendering_into_a_bucket_gives_the_same_data_set(
    bucket: str, small_reference: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    url, temporary = f"{bucket}/rendered", tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr(tempfile, "tempdir", None)
    summary = render_dataset(RECIPE, url, executor=Sabotage(ONE_WORKER, {"train/0002": "raise"}))
    assert (summary.rendered, [entry.name for entry in summary.failures]) == (3, ["train/0002"])
    assert hashes(download(url, tmp_path / "part")) == without(hashes(small_reference), "0002")
    assert (tmp_path / "part/quarantine/TRAIN/A/0002.json").is_file()
    again = render_dataset(RECIPE, url, executor=ONE_WORKER, only=[("train", 2)])
    assert (again.rendered, again.already_there, again.failures) == (1, 3, ())
    assert hashes(download(url, tmp_path / "all")) == hashes(small_reference)
    logs = list((tmp_path / "all/logs").iterdir())
    assert len(logs) == 2
    assert list(temporary.iterdir()) == []  # Nothing of it stays on this machine.


@dataclass(frozen=True)
class HalfWay:
    """Gives every scene up when half of it is uploaded: with a failure, the last one by Ctrl-C."""

    threads: int = 1

    def run(self, function: Callable[[Any], Any], jobs: Iterable[Any]) -> Outcomes[Any, Any]:  # noqa: ARG002
        for job in jobs:
            job.tree.write(f"disparity/TRAIN/A/{job.scene:04d}/left/0006.pfm", b"half")
            if job.scene == 3:
                raise KeyboardInterrupt
            yield Outcome(job, None, Failure("crash", "its process crashed"))


def test_what_was_uploaded_of_an_unfinished_scene_is_removed(bucket: str) -> None:
    url = f"{bucket}/half-way"
    with pytest.raises(KeyboardInterrupt):
        render_dataset(RECIPE, url, executor=HalfWay())
    assert open_tree(url).files_below("disparity") == []
    assert len(open_tree(url).files_below("quarantine")) == 6


def test_a_scene_exists_once_its_manifest_is_uploaded(bucket: str, analytic_dataset: Path) -> None:
    url = f"{bucket}/manifest-last"
    upload(analytic_dataset, url)
    assert len(StereoDataset(url, "train")) == 4
    open_tree(url).remove(Layout(Path()).manifest("train", 1).as_posix())
    assert len(StereoDataset(url, "train")) == 2


def test_reading_and_verifying_a_bucket(bucket: str, analytic_dataset: Path) -> None:
    url = f"{bucket}/read"
    upload(analytic_dataset, url)
    here, there = StereoDataset(analytic_dataset, "test"), StereoDataset(url, "test")
    assert [sample.name for sample in there] == [sample.name for sample in here]
    for mine, other in zip(here, there, strict=True):
        assert (mine.disparity_right == other.disparity_right).all()
        assert (mine.left == other.left).all()
        assert mine.scene_record == other.scene_record
    local, remote = verify_dataset(analytic_dataset), verify_dataset(url)
    assert remote.ok
    assert (remote.scenes, remote.files, remote.bytes_read) == (local.scenes, local.files, local.bytes_read)
    assert str(remote).startswith(f"{url}: no problem")
    tree = open_tree(url)
    name = "disparity/TRAIN/A/0001/left/0006.pfm"
    damaged = bytearray(tree.read(name))
    damaged[777] ^= 4
    tree.write(name, bytes(damaged))
    tree.write("occlusion/TRAIN/A/0009/left/0006.png", b"?")
    assert [str(problem) for problem in verify_dataset(url).problems] == [
        f"{name}: is damaged, its SHA-256 is not the manifest's",
        "occlusion/TRAIN/A/0009/left/0006.png: belongs to no finished scene",
    ]


def test_copies_of_a_scene_that_was_rendered_again_are_renewed(bucket: str, own_dataset: Path) -> None:
    url = f"{bucket}/renewed"
    upload(own_dataset, url)
    before = StereoDataset(url, "train")[0].left
    layout = Layout(own_dataset)
    shutil.copytree(
        layout.scene_folder("frames_cleanpass", "train", 1),
        layout.scene_folder("frames_cleanpass", "train", 0),
        dirs_exist_ok=True,
    )
    vouch(own_dataset, "train", 0)
    upload(own_dataset, url)
    after = StereoDataset(url, "train")[0].left
    assert (after != before).any()
    assert (after == StereoDataset(own_dataset, "train")[0].left).all()


def test_exporting_from_a_bucket_to_a_bucket(bucket: str, analytic_dataset: Path, tmp_path: Path) -> None:
    url = f"{bucket}/source"
    upload(analytic_dataset, url)
    for data, out in ((url, f"{bucket}/shards"), (analytic_dataset, tmp_path / "shards")):
        with pytest.raises(SystemExit) as end:
            main(["export", str(data), "--format", "webdataset", "--out", str(out)])
        assert end.value.code == 0
    tree = open_tree(f"{bucket}/shards")
    assert tree.files_in("") == [
        "export.json",
        "index.json",
        "recipe.yaml",
        "test-000000.tar",
        "train-000000.tar",
    ]
    for name in tree.files_in(""):
        assert tree.read(name) == (tmp_path / "shards" / name).read_bytes()


def test_places_that_are_no_data_set(bucket: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(DatasetError, match=r"s3://stereo/nothing: is not a data set"):
        StereoDataset(f"{bucket}/nothing", "train")
    open_tree(f"{bucket}/thesis").write("thesis.tex", b"do not touch")
    with pytest.raises(DatasetError, match="neither empty nor a data set"):
        render_dataset(RECIPE, f"{bucket}/thesis")
    assert open_tree(f"{bucket}/thesis").files_in("") == ["thesis.tex"]
    for words in (["verify", "nosuch://x"], ["render", "--out", "nosuch://x"]):
        with pytest.raises(SystemExit) as end:
            main(words)
        assert end.value.code == 1
        said = capsys.readouterr().err
        assert "nosuch" in said
        assert said.count("\n") == 1


@pytest.mark.parametrize("kind", ["folder", "memory"])
def test_trees(kind: str, tmp_path: Path) -> None:
    tree: Any = open_tree(tmp_path / "t" if kind == "folder" else f"memory://{tmp_path.name}")
    assert tree.files_in("") == tree.files_below("a") == []
    tree.write("a/b.txt", b"1")
    tree.write("a/c/d.txt", b"2")
    assert tree.exists("a/b.txt")
    assert not tree.exists("a")
    assert tree.files_in("a") == ["b.txt", "c"]
    assert tree.files_below("a") == ["a/b.txt", "a/c/d.txt"]
    (tmp_path / "s" / "x").mkdir(parents=True)
    (tmp_path / "s" / "x" / "y").write_bytes(b"3")
    tree.adopt(tmp_path / "s", "a/c")
    assert tree.read("a/c/x/y") == b"3"
    tree.fetch("a/c/x/y", tmp_path / "z")
    assert (tmp_path / "z").read_bytes() == b"3"
    tree.remove("a/c")
    tree.remove("a/none")
    assert tree.files_below("a") == ["a/b.txt"]
    with pytest.raises(FileNotFoundError):
        tree.read("a/c/x/y")
    with pytest.raises(KeyboardInterrupt):
        write_half(tree, "a/e.txt")
    assert tree.files_in("a") == ["b.txt"]


def write_half(tree: Tree, name: str) -> None:
    with tree.writing(name) as path:
        path.write_bytes(b"half")
        raise KeyboardInterrupt

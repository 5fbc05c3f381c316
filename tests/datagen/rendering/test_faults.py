"""Scenes that fail, disks that fill up, Ctrl-C: the run goes on or stops cleanly, and nothing is lost."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from datagen import render_dataset
from datagen.errors import DiskFullError
from datagen.recipe.recipe import write_recipe
from datagen.rendering.staging import STAGING_FOLDER
from scenes import Scene
from scenes.serialization import from_plain
from stereoforge.cli import main
from tests.datagen.sabotage import ONE_WORKER, RECIPE, Sabotage, hashes, without


def events(root: Path) -> list[dict[str, Any]]:
    logs = sorted((root / "logs").iterdir())
    return [json.loads(line) for log in logs for line in log.read_text().splitlines()]


@pytest.mark.slow
def test_failing_scenes_are_quarantined_and_can_be_tried_again(small_reference: Path, tmp_path: Path) -> None:
    root = tmp_path / "set"
    faults = {"train/0001": "segfault", "train/0002": "eat memory", "train/0003": "raise"}
    summary = render_dataset(RECIPE, root, executor=Sabotage(ONE_WORKER, faults))
    assert (summary.rendered, summary.already_there) == (1, 0)
    assert [(entry.name, entry.kind, entry.attempts) for entry in summary.failures] == [
        ("train/0001", "crash", 2),
        ("train/0002", "memory", 2),
        ("train/0003", "exception", 1),
    ]
    assert hashes(root) == without(hashes(small_reference), "0001", "0002", "0003")
    entry = json.loads((root / "quarantine/TRAIN/A/0001.json").read_text())
    assert from_plain(entry["record"], Scene) == RECIPE.sample("train", 1)
    assert entry["recipe_sha256"] == RECIPE.settings_sha256()
    log = (root / "quarantine/TRAIN/A/0001.log").read_text()
    assert "train/0001 is about to segfault" in log
    assert "Segmentation fault" in log
    assert [line["event"] for line in events(root)].count("scene_failed") == 3
    assert not (root / STAGING_FOLDER).exists()

    # The same command leaves them alone and still says so; a run that is asked to tries them, and only them.
    again = render_dataset(RECIPE, root, executor=ONE_WORKER)
    assert (again.rendered, again.already_there, again.failures) == (0, 1, summary.failures)
    retried = render_dataset(
        RECIPE, root, executor=ONE_WORKER, only=[(entry.split, entry.scene) for entry in again.failures]
    )
    assert (retried.rendered, retried.failures) == (3, ())
    assert hashes(root) == hashes(small_reference)
    assert not [path for path in (root / "quarantine").rglob("*") if path.is_file()]


@pytest.mark.slow
def test_the_command_prints_one_table_of_what_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    executor = Sabotage(ONE_WORKER, {f"train/{n:04d}": "raise" for n in range(2)})
    monkeypatch.setattr("stereoforge.commands.render.local_executor", lambda *_: executor)
    write_recipe(tmp_path / "recipe.yaml", RECIPE)
    with pytest.raises(SystemExit) as end:
        main(
            [
                "render",
                "--recipe",
                str(tmp_path / "recipe.yaml"),
                "--out",
                str(tmp_path / "set"),
                "--scenes",
                "2",
            ]
        )
    assert end.value.code == 1
    said = capfd.readouterr()
    assert said.out.count("RuntimeError: out of ideas") == 2
    assert "2 scenes could not be rendered" in said.err
    assert "Traceback" not in said.out + said.err


def test_a_full_disk_stops_the_run_and_says_what_is_missing(small_reference: Path, tmp_path: Path) -> None:
    root = tmp_path / "set"
    executor = Sabotage(ONE_WORKER, {"train/0001": "fill the disk"})
    with pytest.raises(DiskFullError, match=r"the disk is full; 3 scenes are missing, about \d+ MB"):
        render_dataset(RECIPE, root, executor=executor)
    assert hashes(root) == without(hashes(small_reference), "0001", "0002", "0003")
    assert not (root / "quarantine").exists()
    assert not (root / STAGING_FOLDER).exists()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 1 MiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small file system takes rights that this user does not have")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow
def test_a_file_system_that_fills_up_and_gets_more_room(small_reference: Path, small_disk: Path) -> None:
    root = small_disk / "set"
    root.mkdir()
    ballast = small_disk / "ballast"
    size = sum(path.stat().st_size for path in small_reference.rglob("*") if path.is_file())
    ballast.write_bytes(bytes((1 << 20) - size))
    with pytest.raises(DiskFullError):
        render_dataset(RECIPE, root, executor=ONE_WORKER)
    assert not (root / STAGING_FOLDER).exists()
    done = hashes(root)
    assert done.items() <= hashes(small_reference).items()
    ballast.unlink()
    assert render_dataset(RECIPE, root, executor=ONE_WORKER).failures == ()
    assert hashes(root) == hashes(small_reference)


def children_of(pid: int) -> list[int]:
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found.append(int(status.parent.name))
    return found


def start_command(folder: Path, root: Path, executor: str = "local") -> subprocess.Popen[str]:
    """`stereoforge render` with one worker, and with `folder/temporary` for temporary files."""
    write_recipe(folder / "recipe.yaml", RECIPE)
    (folder / "temporary").mkdir(exist_ok=True)
    words = ["render", "--recipe", str(folder / "recipe.yaml"), "--out", str(root), "--workers", "1"]
    words += ["--executor", executor]
    return subprocess.Popen(
        [sys.executable, "-m", "stereoforge", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "TMPDIR": str(folder / "temporary")},
        # Tests that run in a shell's background are deaf to Ctrl-C, and so would the command be.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )


@pytest.mark.slow
def test_a_killed_command_leaves_nothing_but_what_the_next_one_clears_away(
    small_reference: Path, tmp_path: Path
) -> None:
    root = tmp_path / "set"
    process = start_command(tmp_path, root)
    deadline = time.monotonic() + 300
    # Blender's own folder, which it has for as long as it runs.
    while not list(root.glob(f"{STAGING_FOLDER}/*/train-*/temporary/blender_*")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.kill()
    process.communicate()
    assert list((tmp_path / "temporary").iterdir()) == []
    _, said = start_command(tmp_path, root).communicate()
    assert said == ""
    assert hashes(root) == hashes(small_reference)
    assert not (root / STAGING_FOLDER).exists()
    assert list((tmp_path / "temporary").iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(("executor", "number"), [("local", signal.SIGINT), ("ray", signal.SIGTERM)])
def test_an_interrupted_command_leaves_whole_scenes_and_nothing_else(
    small_reference: Path, tmp_path: Path, executor: str, number: signal.Signals
) -> None:
    root = tmp_path / "set"
    process = start_command(tmp_path, root, executor)
    deadline = time.monotonic() + 300
    while not list(root.glob("manifest/TRAIN/A/*.json")) and time.monotonic() < deadline:
        time.sleep(0.02)
    workers = children_of(process.pid)
    assert workers
    process.send_signal(number)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 130
    assert said.count("\n") == 1
    # The last to go is multiprocessing's own tracker, which ends when it sees that its parent has.
    while any(Path(f"/proc/{pid}").exists() for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not [pid for pid in workers if Path(f"/proc/{pid}").exists()]
    assert list((tmp_path / "temporary").iterdir()) == []
    assert not (root / STAGING_FOLDER).exists()
    done = hashes(root)
    assert done.items() <= hashes(small_reference).items()
    scenes = {path.stem for path in root.glob("manifest/TRAIN/A/*.json")}
    missing = {f"{number:04d}" for number in range(4)} - scenes
    assert missing
    assert done == without(hashes(small_reference), *missing)
    assert events(root)[-1]["event"] == "run_stopped"

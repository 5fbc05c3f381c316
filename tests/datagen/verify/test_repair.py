"""verify --repair renders exactly the broken scenes again."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from datagen.dataset.layout import Layout
from datagen.executors import Failure
from datagen.rendering.quarantine import put_in_quarantine
from stereoforge.cli import main
from stereoforge_kit.files import LocalTree
from tests.datagen.sabotage import RECIPE, hashes


def verify(root: Path, *flags: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(["verify", str(root), "--workers", "1", *flags])
    assert isinstance(end.value.code, int)
    return end.value.code


@pytest.mark.slow
def test_broken_scenes_and_no_others_are_rendered_again(
    small_reference: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    root = Path(shutil.copytree(small_reference, tmp_path / "set"))
    layout = Layout(root)
    untouched = layout.manifest("train", 0).read_bytes()
    disparity = layout.file("disparity", "train", 1, "left", 6)
    flipped = bytearray(disparity.read_bytes())
    flipped[500] ^= 1
    disparity.write_bytes(flipped)
    layout.manifest("train", 2).write_text("{}")
    for path in layout.scene_paths("train", 3):  # missing altogether: not broken, so not repair's business
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    # Nor is what lies in quarantine since the data set was rendered.
    put_in_quarantine(LocalTree(root), tmp_path, RECIPE, "train", 3, Failure("timeout", "ran too long"), 2)
    assert verify(root) == 1
    assert verify(root, "--repair") == 1
    said = capfd.readouterr()
    assert "rendering 2 scenes again" in " ".join(said.out.split())
    assert "are in no finished scene and are left" in said.err
    whole = hashes(small_reference)
    assert hashes(root) == {name: digest for name, digest in whole.items() if "/0003" not in name}
    assert layout.manifest("train", 0).read_bytes() == untouched


@pytest.mark.slow
def test_a_repaired_data_set_is_right_again(small_reference: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(small_reference, tmp_path / "set"))
    Layout(root).file("occlusion", "train", 1, "right", 6).write_bytes(b"")
    Layout(root).manifest("train", 2).write_text('{"family":')  # Its files then belong to no finished scene.
    assert verify(root, "--repair") == 0
    assert hashes(root) == hashes(small_reference)

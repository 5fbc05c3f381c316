"""`stereoforge refine` of two folders, and `StereoRefiner` from Python."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from datagen.cameras.calibration import Calibration
from datagen.formats import read_pfm, read_png, write_png
from stereoforge import StereoRefiner
from stereoforge.cli import main
from stereoforge.errors import CommandError

SHIFT_PX = 6


def picture_pair(seed: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """A picture of blots, and what a camera beside sees of it as a wall."""
    rng = np.random.default_rng(seed)
    wide = cv2.resize(rng.integers(0, 256, (16, 32, 3), np.uint8), (160, 64), interpolation=cv2.INTER_CUBIC)
    return wide[:, :128], wide[:, SHIFT_PX : 128 + SHIFT_PX]


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    for number in range(3):
        for name, view in zip(("left", "right"), picture_pair(number), strict=True):
            write_png(tmp_path / name / f"{number:03d}.png", view)
    (tmp_path / "left" / "._000.png").write_bytes(b"a dropping")
    return tmp_path / "left", tmp_path / "right"


def told(capsys: pytest.CaptureFixture[str], code: int, *words: str | Path) -> str:
    """All that refine says, on one line, where it ends with this code."""
    with pytest.raises(SystemExit) as end:
        main(["refine", *map(str, words)])
    said = capsys.readouterr()
    assert int(end.value.code or 0) == code, said.err
    return " ".join((said.out + said.err).split())


def written(out: Path) -> dict[str, bytes]:
    return {str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*") if path.is_file()}


def test_two_folders_and_where_they_were_stopped(
    folders: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert "3 pairs refined, 0 were there already" in told(capsys, 0, *folders, "--out", out)
    before = written(out)
    names = {name.split("/")[0] for name in before}
    assert names == {"000", "001", "002", "settings.json"}
    disparity = read_pfm(out / "001" / "disparity.pfm")
    assert np.median(np.abs(disparity[:, 2 * SHIFT_PX :] - SHIFT_PX)) < 0.5

    # As if it had been stopped within the last pair, whose overview is written last.
    (out / "002" / "overview.png").unlink()
    (out / "002" / "confidence.pfm").unlink()
    assert "1 pairs refined, 2 were there already" in told(capsys, 0, *folders, "--out", out)
    assert written(out) == before
    refusal = told(capsys, 1, *folders, "--out", out, "--max-disparity", "32")
    assert "holds results of other settings (max_disparity); choose another folder" in refusal
    assert written(out) == before


def test_one_pair_is_the_same_as_in_a_folder_and_as_from_python(
    folders: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = (folder / "001.png" for folder in folders)
    told(capsys, 0, left, right, "--out", tmp_path / "one")
    refiner = StereoRefiner(device="cpu")
    pairs = [(read_png(left), read_png(right)), picture_pair(0)]
    refined = list(refiner.batch(pairs))
    np.testing.assert_array_equal(read_pfm(tmp_path / "one" / "disparity.pfm"), refined[0].disparity)
    np.testing.assert_array_equal(read_pfm(tmp_path / "one" / "confidence.pfm"), refined[0].confidence)
    assert refined[1].deviation is None
    assert refined[1].gradient.shape == (64, 128, 2)
    assert refiner(*pairs[0], deviation_samples=2).deviation is not None
    rig = Calibration(fx=500.0, fy=500.0, cx_left=64.0, cx_right=66.0, cy=32.0, baseline_m=0.1)
    expected = 500 * 0.1 / (refined[0].disparity.astype(np.float64) + 2)
    np.testing.assert_allclose(refined[0].depth(rig), np.where(expected > 0, expected, np.inf))
    with pytest.raises(CommandError, match='needs predictor="sgbm"'):
        refiner(*pairs[0], disparity=refined[0].disparity)
    with pytest.raises(CommandError, match="the images differ in size: left 128x64, right 127x64"):
        refiner(pairs[0][0], pairs[0][1][:, 1:])


def test_what_does_not_pair_up_is_a_sentence(
    folders: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = folders
    out = ("--out", tmp_path / "out")
    assert "is no folder, and" in told(capsys, 2, left, right / "000.png", *out)
    (right / "002.png").unlink()
    assert f"3 left and 2 right pictures ({left / '002.png'} has none)" in told(capsys, 2, left, right, *out)
    (tmp_path / "empty").mkdir()
    assert "holds no pictures" in told(capsys, 2, left, tmp_path / "empty", *out)
    assert "which is only read" in told(capsys, 2, left, left, "--out", left / "results")
    assert not (tmp_path / "out").exists()
    (left / "002.png").rename(left / "000.jpg")
    (right / "001.png").rename(right / "b.png")
    (right / "000.png").rename(right / "a.png")
    write_png(right / "c.png", picture_pair(2)[1])
    assert "two pictures have the same name" in told(capsys, 2, left, right, *out)


def test_pictures_of_other_names_are_paired_in_their_order(
    folders: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    left, right = folders
    for path in [*right.iterdir()]:
        path.rename(right / f"right_{path.name}")
    said = told(capsys, 0, left, right, "--out", tmp_path / "out")
    assert "paired in the order of their names, such as 000.png and right_000.png" in said
    write_png(left / "001.png", picture_pair(1)[0][:60])
    (tmp_path / "again").mkdir()
    (tmp_path / "again" / "mine.txt").write_text("keep")
    assert "holds something else already" in told(capsys, 1, left, right, "--out", tmp_path / "again")
    assert "differ in size" in told(capsys, 1, left, right, "--out", tmp_path / "other")
    assert (tmp_path / "other" / "000" / "overview.png").is_file()  # what was done stays


def test_a_list_of_pairs(
    folders: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Results are named after the left pictures; columns after the second are left out."""
    pairs = tmp_path / "pairs.txt"
    lines = [f"left/{name}.png right/{name}.png disparity/{name}.pfm" for name in ("000", "002")]
    pairs.write_text("\n".join(["# ours", *lines]) + "\n")
    out = tmp_path / "out"
    assert "2 pairs refined, 0 were there already" in told(capsys, 0, pairs, "--out", out)
    assert sorted(path.name for path in out.iterdir()) == ["left_000", "left_002", "settings.json"]
    told(capsys, 0, folders[0] / "002.png", folders[1] / "002.png", "--out", tmp_path / "one")
    one = read_pfm(tmp_path / "one" / "disparity.pfm")
    np.testing.assert_array_equal(read_pfm(out / "left_002" / "disparity.pfm"), one)


def test_lists_that_cannot_be(
    folders: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pairs, out = tmp_path / "pairs.csv", tmp_path / "out"
    for text, sentence in (
        ("left/000.png,right/009.png\n", "line 1: there is no file"),
        ("left/000.png,right/000.png\nleft/001.png\n", "line 2 has 1 column where there should be 2"),
        ("left/000.png,right/000.png\n" * 2, "line 2: its results would be called left_000"),
        ("", "names no pair; each line needs left and right"),
    ):
        pairs.write_text(text)
        with pytest.raises(SystemExit) as end:
            main(["refine", str(pairs), "--out", str(out)])
        assert sentence in " ".join(capsys.readouterr().err.split())
        assert end.value.code in (1, 2)
    alone = told(capsys, 2, folders[0] / "000.png", "--out", out)
    assert "is no list of pairs (.txt, .csv, .tsv, .lst), and no RIGHT goes with it" in alone
    assert not out.exists()

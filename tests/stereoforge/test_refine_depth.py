"""`stereoforge refine` with a calibration: depths and points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from datagen.formats import read_pfm, read_png, write_png
from datagen.formats.depth_exr import read_depth
from datagen.formats.disparity import read_disparity_map
from stereoforge.pipelines.refined_files import write_found
from tests.stereoforge.test_refine_many import SHIFT_PX, picture_pair, told

FOCAL_PX, BASELINE_M, DOFFS = 500.0, 0.1, 2.0


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    for name, view in zip(("left", "right"), picture_pair(1), strict=True):
        write_png(tmp_path / f"{name}.png", view)
    return tmp_path / "left.png", tmp_path / "right.png"


def test_depth_in_three_formats_and_points(
    pair: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All follow from disparity.pfm; the points are those of confident pixels away from steps, in their colours."""
    out = tmp_path / "out"
    rig = ("--focal-px", str(FOCAL_PX), "--baseline-m", str(BASELINE_M), "--doffs", str(DOFFS))
    said = told(capsys, 0, *pair, "--out", out, *rig, "--min-confidence", "0.2")
    disparity = read_pfm(out / "disparity.pfm").astype(np.float64)
    depth = FOCAL_PX * BASELINE_M / (disparity + DOFFS)
    np.testing.assert_allclose(read_depth(out / "depth.exr"), depth, rtol=1e-6)
    np.testing.assert_array_equal(np.load(out / "depth.npy"), read_depth(out / "depth.exr"))
    np.testing.assert_allclose(read_png(out / "depth.png"), np.rint(depth * 1000), atol=1)
    assert abs(np.median(depth) - FOCAL_PX * BASELINE_M / (SHIFT_PX + DOFFS)) < 0.5

    cloud = trimesh.load(out / "points.ply")
    kept = read_pfm(out / "confidence.pfm") >= 0.2
    steps = np.zeros_like(kept)
    for axis in (0, 1):
        step = np.abs(np.diff(disparity.astype(np.float32), axis=axis)) > 1
        steps |= np.pad(step, [(0, 1 - axis), (0, axis)]) | np.pad(step, [(1 - axis, 0), (axis, 0)])
    kept &= ~steps
    rows, columns = np.nonzero(kept)
    expected = np.stack([(columns - 63.5) / FOCAL_PX, (rows - 31.5) / FOCAL_PX, np.ones(len(rows))], axis=1)
    np.testing.assert_allclose(cloud.vertices, expected * depth[kept][:, None], rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(cloud.colors[:, :3], read_png(pair[0])[kept])
    assert f"points.ply: {kept.mean():.1%} of the pixels" in said


def test_a_calibration_file_is_scaled_or_refused(
    pair: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calib = tmp_path / "calib.txt"
    lines = ["cam0=[1000 0 128; 0 1000 64; 0 0 1]", "cam1=[1000 0 132; 0 1000 64; 0 0 1]"]
    calib.write_text("\n".join([*lines, "doffs=4", "baseline=100", "width=256", "height=128"]))
    said = told(capsys, 0, *pair, "--out", tmp_path / "out", "--calibration", calib)
    assert "the calibration of 256x128 pictures was scaled to 128x64" in said
    disparity = read_pfm(tmp_path / "out" / "disparity.pfm").astype(np.float64)
    np.testing.assert_allclose(np.load(tmp_path / "out" / "depth.npy"), 50 / (disparity + 2), rtol=1e-6)

    calib.write_text("\n".join([*lines, "doffs=4", "baseline=100", "width=256", "height=200"]))
    refused = told(capsys, 1, *pair, "--out", tmp_path / "none", "--calibration", calib)
    assert "images of 128x64 have another shape than the camera's 256x200" in refused
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("flags", "sentence"),
    [
        (["--focal-px", "500"], "depth needs both --focal-px and --baseline-m"),
        (["--focal-px", "-1", "--baseline-m", "1"], "--focal-px must be positive"),
        (["--focal-px", "500", "--baseline-m", "nan"], "--baseline-m must be positive"),
        (["--focal-px", "5", "--baseline-m", "1", "--doffs", "inf"], "--doffs must be finite"),
        (["--min-confidence", "2"], "--min-confidence must lie between 0 and 1"),
        (["--video"], "--video is for folders and videos"),
    ],
)
def test_impossible_flags(
    pair: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    flags: list[str],
    sentence: str,
) -> None:
    assert sentence in told(capsys, 2, *pair, "--out", tmp_path / "out", *flags)
    assert not (tmp_path / "out").exists()


def test_the_disparity_in_other_formats(
    pair: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All hold what disparity.pfm holds, the PNG file to half of its unit; a format there is not is refused first."""
    out = tmp_path / "out"
    told(capsys, 0, *pair, "--out", out, "--also-as", "png, npy,npz,tiff,.EXR")
    disparity = read_pfm(out / "disparity.pfm")
    for ending in ("npy", "npz", "tiff", "exr"):
        np.testing.assert_array_equal(read_disparity_map(out / f"disparity.{ending}"), disparity)
    np.testing.assert_allclose(read_disparity_map(out / "disparity.png"), disparity, atol=1 / 512)

    refused = told(capsys, 2, *pair, "--out", tmp_path / "none", "--also-as", "png,jpg")
    assert (
        "--also-as takes names of formats, comma-separated, of exr, npy, npz, png, tiff, not 'jpg'" in refused
    )
    assert not (tmp_path / "none").exists()


def test_a_png_file_says_what_it_does_not_hold(tmp_path: Path) -> None:
    disparity = np.array([[1.5, 300.0], [2.25, 255.5]], np.float32)
    remarks = write_found(tmp_path / "disparity.png", disparity)
    assert remarks == ["disparity.png holds no disparity above 256 px: 25.0% of the pixels are 0"]
    found = read_disparity_map(tmp_path / "disparity.png")
    np.testing.assert_array_equal(found, [[1.5, np.nan], [2.25, 255.5]])

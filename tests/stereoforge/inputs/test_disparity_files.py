"""Other people's disparity: what each format's markers become, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from datagen import DatasetError
from datagen.formats import write_pfm, write_png
from stereoforge.errors import CommandError
from stereoforge.inputs.disparity_files import read_disparity

NAN = np.nan


def test_markers_of_no_disparity_become_nan(tmp_path: Path) -> None:
    write_pfm(tmp_path / "a.pfm", np.array([[1.5, np.inf, NAN], [-np.inf, -3.0, 0.0]], np.float32))
    disparity, remarks = read_disparity(tmp_path / "a.pfm", (2, 3))
    np.testing.assert_array_equal(disparity, [[1.5, NAN, NAN], [NAN, NAN, 0]])
    assert remarks == [
        f"{tmp_path / 'a.pfm'}: 33.33% of the disparities cannot be and are left out (33.33% negative)"
    ]
    write_png(tmp_path / "b.png", np.array([[0, 256, 384], [65535, 1, 0]], np.uint16))
    disparity, _ = read_disparity(tmp_path / "b.png", (2, 3))
    np.testing.assert_array_equal(disparity, [[NAN, 1, 1.5], [NAN, 1 / 256, NAN]])


def test_what_was_taken_for_granted_is_said(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.array([[24, -16, 320]], np.int16))
    disparity, remarks = read_disparity(path, (1, 3))
    np.testing.assert_array_equal(disparity, np.array([[1.5, NAN, NAN]], np.float32))
    assert remarks[0] == f"{path}: int16 is taken for OpenCV's fixed point, 16 units a pixel"
    assert "50.00% larger than the picture is wide" in remarks[1]
    disparity, remarks = read_disparity(path, (1, 3), 160)
    np.testing.assert_array_equal(disparity, np.array([[0.15, NAN, 2]], np.float32))
    assert remarks == []


@pytest.mark.parametrize("sentinel", [65535.0, 1e30, -999.0])
def test_sentinels_are_no_disparity(tmp_path: Path, sentinel: float) -> None:
    expected = np.full((90, 160), 12.5, np.float32)
    expected[:4, :4], expected[:, -10:] = NAN, NAN
    write_pfm(tmp_path / "a.pfm", np.where(np.isnan(expected), sentinel, expected))
    disparity, (remark,) = read_disparity(tmp_path / "a.pfm", (90, 160))
    np.testing.assert_array_equal(disparity, expected)
    assert "6.36% of the disparities cannot be" in remark


def test_little_below_zero_is_noise(tmp_path: Path) -> None:
    write_pfm(tmp_path / "a.pfm", np.array([[-0.9, 2.0, -0.1]], np.float32))
    disparity, remarks = read_disparity(tmp_path / "a.pfm", (1, 3))
    np.testing.assert_array_equal(disparity, np.array([[0, 2, 0]], np.float32))
    assert remarks == []


def test_the_other_sign_is_guessed(tmp_path: Path) -> None:
    path = tmp_path / "a.pfm"
    write_pfm(path, np.full((2, 3), -2.5, np.float32))
    with pytest.raises(CommandError, match=r"holds no disparity, .*; is the sign the other way round\?"):
        read_disparity(path, (2, 3))
    write_pfm(path, np.array([[-2.5, -2.5, 1]], np.float32))
    assert read_disparity(path, (1, 3))[1][0].endswith("is the sign the other way round?")


def test_three_channels_that_are_alike_are_one(tmp_path: Path) -> None:
    disparity = np.array([[1.5, NAN, 2], [3, 1, 0]], np.float32)
    write_pfm(tmp_path / "a.PFM", np.repeat(disparity[..., None], 3, axis=2))
    np.testing.assert_array_equal(read_disparity(tmp_path / "a.PFM", (2, 3))[0], disparity)


def test_other_files_are_refused_by_name(tmp_path: Path) -> None:
    write_pfm(tmp_path / "nothing.pfm", np.full((2, 3), np.inf, np.float32))
    write_pfm(tmp_path / "color.pfm", np.arange(18, dtype=np.float32).reshape(2, 3, 3))
    write_png(tmp_path / "grey.png", np.zeros((2, 3), np.uint8))
    (tmp_path / "cut.pfm").write_bytes(b"Pf\n3 2\n-1.0\n1234")
    (tmp_path / "map.jpg").write_bytes(b"")
    for name, reason in (
        ("nothing.pfm", "holds no disparity"),
        ("map.jpg", r"\.pfm, a 16-bit \.png or a \.tiff file"),
        ("gone.pfm", "no such file"),
    ):
        with pytest.raises(CommandError, match=f"{name}: .*{reason}"):
            read_disparity(tmp_path / name, (2, 3))
    for name, reason in (
        ("grey.png", "uint8 in unknown units; say with --disparity-scale"),
        ("cut.pfm", "header promises"),
        ("color.pfm", "three channels that differ"),
    ):
        with pytest.raises(DatasetError, match=f"{name}: .*{reason}"):
            read_disparity(tmp_path / name, (2, 3))
    write_pfm(tmp_path / "small.pfm", np.ones((2, 3), np.float32))
    with pytest.raises(CommandError, match="is 3x2, the pictures are 9x8"):
        read_disparity(tmp_path / "small.pfm", (8, 9))

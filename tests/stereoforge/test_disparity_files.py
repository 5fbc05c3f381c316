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
    np.testing.assert_array_equal(
        read_disparity(tmp_path / "a.pfm", (2, 3)), [[1.5, NAN, NAN], [NAN, NAN, 0]]
    )
    write_png(tmp_path / "b.png", np.array([[0, 256, 384], [65535, 1, 0]], np.uint16))
    np.testing.assert_array_equal(
        read_disparity(tmp_path / "b.png", (2, 3)), [[NAN, 1, 1.5], [65535 / 256, 1 / 256, NAN]]
    )


def test_three_channels_that_are_alike_are_one(tmp_path: Path) -> None:
    disparity = np.array([[1.5, NAN, 2], [3, 4, 5]], np.float32)
    write_pfm(tmp_path / "a.PFM", np.repeat(disparity[..., None], 3, axis=2))
    np.testing.assert_array_equal(read_disparity(tmp_path / "a.PFM", (2, 3)), disparity)


def test_other_files_are_refused_by_name(tmp_path: Path) -> None:
    write_pfm(tmp_path / "nothing.pfm", np.full((2, 3), np.inf, np.float32))
    write_pfm(tmp_path / "color.pfm", np.arange(18, dtype=np.float32).reshape(2, 3, 3))
    write_png(tmp_path / "grey.png", np.zeros((2, 3), np.uint8))
    (tmp_path / "cut.pfm").write_bytes(b"Pf\n3 2\n-1.0\n1234")
    (tmp_path / "map.tif").write_bytes(b"")
    for name, reason in (
        ("nothing.pfm", "holds no disparity"),
        ("map.tif", r"\.pfm or a 16-bit \.png"),
        ("gone.pfm", "no such file"),
    ):
        with pytest.raises(CommandError, match=f"{name}: .*{reason}"):
            read_disparity(tmp_path / name, (2, 3))
    for name, reason in (
        ("grey.png", "16-bit grey PNG"),
        ("cut.pfm", "header promises"),
        ("color.pfm", "three channels that differ"),
    ):
        with pytest.raises(DatasetError, match=f"{name}: .*{reason}"):
            read_disparity(tmp_path / name, (2, 3))
    write_pfm(tmp_path / "small.pfm", np.ones((2, 3), np.float32))
    with pytest.raises(CommandError, match="is 3x2, the pictures are 9x8"):
        read_disparity(tmp_path / "small.pfm", (8, 9))

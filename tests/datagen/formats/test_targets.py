"""The formats of the targets over time and of normals: what is written is read, and nothing else is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from datagen.errors import FormatError
from datagen.formats import (
    read_flow,
    read_gradient,
    read_mask,
    read_normals,
    write_flow,
    write_gradient,
    write_mask,
    write_normals,
    write_pfm,
)

RNG = np.random.default_rng(0)
FLOW = RNG.normal(size=(5, 7, 2)).astype(np.float32)
MASK = RNG.random((5, 7)) < 0.4


def test_flow_keeps_its_values_and_its_invalid_pixels(tmp_path: Path) -> None:
    flow = FLOW.copy()
    flow[2, 3] = np.nan
    write_flow(tmp_path / "a.pfm", flow)
    assert np.array_equal(read_flow(tmp_path / "a.pfm"), flow, equal_nan=True)
    write_pfm(tmp_path / "b.pfm", FLOW[..., 0])
    with pytest.raises(FormatError, match=r"b\.pfm: has one channel"):
        read_flow(tmp_path / "b.pfm")
    with pytest.raises(FormatError, match=r"c\.pfm: optical flow is"):
        write_flow(tmp_path / "c.pfm", FLOW[..., :1])


def test_a_mask_is_a_grey_map_that_others_read(tmp_path: Path) -> None:
    path = tmp_path / "a.pgm"
    write_mask(path, MASK)
    assert np.array_equal(read_mask(path), MASK)
    assert path.read_bytes().startswith(b"P5\n7 5\n255\n")
    import cv2

    assert np.array_equal(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), np.where(MASK, 255, 0))


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"P2\n2 2\n255\n0 0 0 0", "header does not parse"),
        (b"P5\n2 2\n255\n\0\0\0", "has 14 bytes where its header promises 15"),
        (b"P5\n2 2\n255\n\0\0\0\7", "greys other than 0 and 255"),
        (b"P5\n0 2\n255\n", "0 x 2 pixels"),
        (b"P5\n99999 99999\n255\n", "more than the"),
    ],
)
def test_what_is_no_mask_is_refused(tmp_path: Path, content: bytes, sentence: str) -> None:
    path = tmp_path / "a.pgm"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=sentence):
        read_mask(path)


def test_normals_are_not_gradients(tmp_path: Path) -> None:
    normals = RNG.normal(size=(20, 7, 3)).astype(np.float32)
    write_normals(tmp_path / "a.exr", normals)
    assert np.array_equal(read_normals(tmp_path / "a.exr"), normals)
    with pytest.raises(FormatError, match="float channels dx, dy, valid"):
        read_gradient(tmp_path / "a.exr")
    write_gradient(tmp_path / "b.exr", FLOW, MASK)
    with pytest.raises(FormatError, match="float channels x, y, z"):
        read_normals(tmp_path / "b.exr")
    with pytest.raises(FormatError, match="normals are"):
        write_normals(tmp_path / "c.exr", FLOW)

"""PFM against OpenCV's and Pillow's readers, against bytes written by hand, and against damage."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from datagen.errors import FormatError
from datagen.formats import read_pfm, read_pfm_disparity, write_pfm

one_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
sides = st.integers(1, 12)
floats = hnp.arrays(
    np.float32,
    st.one_of(st.tuples(sides, sides), st.tuples(sides, sides, st.just(3))),
    elements=st.floats(width=32, allow_nan=True, allow_infinity=True),
)


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


@one_folder
@given(floats)
def test_round_trip_keeps_every_bit(tmp_path: Path, array: np.ndarray) -> None:
    write_pfm(tmp_path / "a.pfm", array)
    assert same_bits(read_pfm(tmp_path / "a.pfm"), array)


@one_folder
@given(hnp.arrays(np.float32, st.tuples(sides, sides), elements=st.floats(-1e6, 1e6, width=32)))
def test_opencv_and_pillow_read_what_is_written(tmp_path: Path, array: np.ndarray) -> None:
    path = tmp_path / "a.pfm"
    write_pfm(path, array)
    np.testing.assert_array_equal(cv2.imread(str(path), cv2.IMREAD_UNCHANGED), array)
    np.testing.assert_array_equal(np.asarray(Image.open(path)), array)


def test_opencv_reads_the_same_colours(tmp_path: Path) -> None:
    array = np.arange(2 * 3 * 3, dtype=np.float32).reshape(2, 3, 3)
    write_pfm(tmp_path / "a.pfm", array)
    blue_green_red = cv2.imread(str(tmp_path / "a.pfm"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(blue_green_red[..., ::-1], array)


def test_known_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.pfm"
    write_pfm(path, np.array([[1.0, 2.0], [-0.5, np.inf]]))
    bottom, top = "000000bf 0000807f", "0000803f 00000040"
    assert path.read_bytes() == b"Pf\n2 2\n-1.0\n" + bytes.fromhex(bottom + top)


@pytest.mark.parametrize(("scale", "order"), [("-1", "<"), ("1.0", ">"), ("-0.003922", "<"), ("2e3", ">")])
@pytest.mark.parametrize("header", ["Pf\n3 2\n{}\n", "Pf 3 2 {} ", "Pf\r\n3\t2\r\n{}\n"])
def test_either_byte_order_any_white_space_and_the_scale_is_not_applied(
    tmp_path: Path, scale: str, order: str, header: str
) -> None:
    array = np.array([[1, 2, 3], [4, 5, 6]], np.float32)
    path = tmp_path / "a.pfm"
    path.write_bytes(header.format(scale).encode() + array[::-1].astype(f"{order}f4").tobytes())
    assert same_bits(read_pfm(path), array)


@pytest.mark.parametrize("end", [b"", b"\n", b"\r\n"])
@pytest.mark.parametrize(
    "header",
    [
        b"Pf\r\n3 2\r\n-1\r\n",
        b"Pf \n3 2 \n-1.0 \n",
        b"Pf\n# made by a program\n3 2\n# little endian\n-1\n",
        b"Pf # a comment\n3 # width\n2\n-1 # scale\n",
        b"Pf\n3\n2\n-1\n",
        b"Pf\n3 2\n-1\n# one more\n",
    ],
)
@pytest.mark.parametrize("first", [0x0, 0xA, 0x20, 0xD, 0x23])
def test_dialects_of_other_programs(tmp_path: Path, header: bytes, end: bytes, first: int) -> None:
    """Also where the first byte of the numbers looks like white space or like a comment."""
    array = np.array([[1, 2, 3], [4, 5, 6]], np.float32)
    array[1:, :1].view(np.uint8)[0, 0] = first
    path = tmp_path / "a.PFM"
    path.write_bytes(header + array[::-1].tobytes() + end)
    assert same_bits(read_pfm(path), array)
    path.write_bytes(b"Pf 3 2 -1 " + array[::-1].tobytes())
    assert same_bits(read_pfm(path), array)


def test_a_disparity_of_three_channels(tmp_path: Path) -> None:
    path = tmp_path / "a.pfm"
    disparity = np.array([[1, np.nan, np.inf]], np.float32)
    write_pfm(path, np.repeat(disparity[..., None], 3, axis=2))
    assert same_bits(read_pfm_disparity(path), disparity)
    write_pfm(path, np.arange(3, dtype=np.float32).reshape(1, 1, 3))
    with pytest.raises(FormatError, match=r"a\.pfm: has three channels that differ"):
        read_pfm_disparity(path)


def test_pillow_agrees_on_big_endian(tmp_path: Path) -> None:
    path = tmp_path / "a.pfm"
    values = np.random.default_rng(1).normal(size=(4, 5)).astype(">f4")
    path.write_bytes(b"Pf\n5 4\n1\n" + values.tobytes())
    np.testing.assert_array_equal(read_pfm(path), np.asarray(Image.open(path)))


DAMAGED = {
    "empty": b"",
    "another format": b"P6\n1 1\n255\nabc",
    "no scale": b"Pf\n1 1\n",
    "words for numbers": b"Pf\none 1\n-1\n0000",
    "negative width": b"Pf\n-1 1\n-1\n0000",
    "zero height": b"Pf\n1 0\n-1\n",
    "scale zero": b"Pf\n1 1\n0\n0000",
    "scale minus zero": b"Pf\n1 1\n-0.0\n0000",
    "scale nan": b"Pf\n1 1\nnan\n0000",
    "scale infinite": b"Pf\n1 1\n-inf\n0000",
    "scale no number": b"Pf\n1 1\n1.0.0\n0000",
    "one byte short": b"Pf\n1 1\n-1\n000",
    "one byte more": b"Pf\n1 1\n-1\n00000",
    "three channels promised": b"PF\n1 1\n-1\n0000",
    "more elements than allowed": b"Pf\n16385 16384\n-1\n0000",
    "a size that overflows": b"Pf\n999999999 999999999\n-1\n0000",
    "endless digits": b"Pf\n" + b"9" * 5000 + b" 1\n-1\n",
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_is_one_sentence_naming_the_file(tmp_path: Path, name: str) -> None:
    path = tmp_path / "broken.pfm"
    path.write_bytes(DAMAGED[name])
    with pytest.raises(FormatError) as caught:
        read_pfm(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    for path in (tmp_path / "nothing.pfm", tmp_path):
        with pytest.raises(FormatError, match=str(path)):
            read_pfm(path)


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (2,), (2, 2, 1), (2, 2, 4), (1, 2, 2, 3)])
def test_shapes_that_the_format_cannot_hold(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(FormatError, match=r"a\.pfm: a PFM file holds"):
        write_pfm(tmp_path / "a.pfm", np.zeros(shape, np.float32))
    assert list(tmp_path.iterdir()) == []

"""PNG against Pillow, checksums against damage, and the occlusion code on top of it."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from datagen.errors import FormatError
from datagen.formats import read_occlusion, read_png, write_occlusion, write_png
from datagen.formats.png import read_png_size

one_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
sides = st.integers(1, 20)
pictures = st.sampled_from([np.uint8, np.uint16]).flatmap(
    lambda dtype: hnp.arrays(dtype, st.one_of(st.tuples(sides, sides), st.tuples(sides, sides, st.just(3))))
)


@one_folder
@given(pictures)
def test_round_trip(tmp_path: Path, array: np.ndarray) -> None:
    path = tmp_path / "a.png"
    write_png(path, array)
    again = read_png(path)
    assert again.dtype == array.dtype
    np.testing.assert_array_equal(again, array)
    assert read_png_size(path) == array.shape[:2]


@one_folder
@given(hnp.arrays(np.uint8, st.tuples(sides, sides, st.just(3))))
def test_pillow_reads_and_writes_the_same_colours(tmp_path: Path, array: np.ndarray) -> None:
    path = tmp_path / "a.png"
    write_png(path, array)
    np.testing.assert_array_equal(np.asarray(Image.open(path)), array)
    Image.fromarray(array).save(path)
    np.testing.assert_array_equal(read_png(path), array)


@one_folder
@given(hnp.arrays(np.uint16, st.tuples(sides, sides)))
def test_pillow_reads_the_same_16_bit_grey(tmp_path: Path, array: np.ndarray) -> None:
    write_png(tmp_path / "a.png", array)
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), array)


def test_palette_alpha_and_one_bit_images_of_others(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    colours = rng.integers(0, 4, (6, 7, 3), dtype=np.uint8) * 85
    path = tmp_path / "a.png"
    paletted = Image.fromarray(colours).quantize(64)
    paletted.save(path)
    np.testing.assert_array_equal(read_png(path), np.asarray(paletted.convert("RGB")))
    with_alpha = np.dstack([colours, colours[..., :1]])
    Image.fromarray(with_alpha, "RGBA").save(path)
    np.testing.assert_array_equal(read_png(path), with_alpha)
    Image.fromarray(colours[..., 0] > 100).save(path)
    np.testing.assert_array_equal(read_png(path), np.where(colours[..., 0] > 100, 255, 0))


def test_same_picture_same_bytes(tmp_path: Path) -> None:
    array = np.random.default_rng(3).integers(0, 255, (50, 60, 3), dtype=np.uint8)
    write_png(tmp_path / "a.png", array)
    write_png(tmp_path / "b.png", array.copy(order="F"))
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def chunk(name: bytes, content: bytes) -> bytes:
    body = name + content
    return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))


def png(*chunks: bytes) -> bytes:
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


HEADER = chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 2, 8, 0, 0, 0, 0))
PIXELS = chunk(b"IDAT", zlib.compress(b"\0\1\2" * 2))
END = chunk(b"IEND", b"")
DAMAGED = {
    "empty": b"",
    "a JPEG": b"\xff\xd8\xff\xe0" + b"0" * 100,
    "signature alone": png(),
    "no end": png(HEADER, PIXELS),
    "no header": png(PIXELS, END),
    "two headers": png(HEADER, HEADER, PIXELS, END),
    "header late": png(chunk(b"tEXt", b"a\0b"), HEADER, PIXELS, END),
    "short header": png(chunk(b"IHDR", b"\0" * 12), PIXELS, END),
    "bytes after the end": png(HEADER, PIXELS, END, b"x"),
    "wrong checksum": png(HEADER, PIXELS[:-1] + b"x", END),
    "chunk longer than the file": png(HEADER, b"\x7f\xff\xff\xffIDAT", END),
    "no pixels": png(HEADER, END),
    "too few pixels": png(HEADER, chunk(b"IDAT", zlib.compress(b"\0\1\2")), END),
    "pixels that do not inflate": png(HEADER, chunk(b"IDAT", b"not zlib at all"), END),
    "no width": png(chunk(b"IHDR", struct.pack(">IIBBBBB", 0, 2, 8, 0, 0, 0, 0)), PIXELS, END),
    "huge": png(chunk(b"IHDR", struct.pack(">IIBBBBB", 2**31 - 1, 2**31 - 1, 8, 0, 0, 0, 0)), PIXELS, END),
    "beyond the limit": png(chunk(b"IHDR", struct.pack(">IIBBBBB", 8193, 8192, 8, 0, 0, 0, 0)), PIXELS, END),
    "impossible depth": png(chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 2, 7, 0, 0, 0, 0)), PIXELS, END),
    "animated": png(HEADER, chunk(b"acTL", struct.pack(">II", 2, 0)), PIXELS, END),
}


def test_the_hand_made_chunks_are_right(tmp_path: Path) -> None:
    path = tmp_path / "good.png"
    path.write_bytes(png(HEADER, PIXELS, END))
    np.testing.assert_array_equal(read_png(path), [[1, 2], [1, 2]])


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_is_one_sentence_naming_the_file(tmp_path: Path, name: str) -> None:
    path = tmp_path / "broken.png"
    path.write_bytes(DAMAGED[name])
    with pytest.raises(FormatError) as caught:
        read_png(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["empty", "a JPEG", "signature alone", "short header", "no width", "huge"])
def test_size_of_a_damaged_file(tmp_path: Path, name: str) -> None:
    path = tmp_path / "broken.png"
    path.write_bytes(DAMAGED[name])
    with pytest.raises(FormatError, match=r"broken\.png: "):
        read_png_size(path)


def test_every_single_bit_flip_is_found(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_png(path, np.random.default_rng(0).integers(0, 255, (4, 5, 3), dtype=np.uint8))
    good = path.read_bytes()
    for bit in range(8 * len(good)):
        damaged = bytearray(good)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(FormatError, match=r"a\.png: "):
            read_png(path)


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((0, 4), np.uint8),
        np.zeros((4, 4), np.float32),
        np.zeros((4, 4), bool),
        np.zeros((4, 4, 4), np.uint8),
        np.zeros(4, np.uint8),
    ],
    ids=["no pixels", "float", "bool", "four channels", "one axis"],
)
def test_arrays_that_are_no_picture(tmp_path: Path, array: np.ndarray) -> None:
    with pytest.raises(FormatError, match=r"a\.png: a PNG file holds"):
        write_png(tmp_path / "a.png", array)
    assert list(tmp_path.iterdir()) == []


@one_folder
@given(hnp.arrays(np.uint8, st.tuples(sides, sides), elements=st.integers(0, 2)))
def test_occlusion_round_trip_and_its_greys(tmp_path: Path, labels: np.ndarray) -> None:
    path = tmp_path / "o.png"
    write_occlusion(path, labels)
    np.testing.assert_array_equal(read_occlusion(path), labels)
    np.testing.assert_array_equal(np.asarray(Image.open(path)), np.choose(labels, [0, 255, 128]))


def test_occlusion_refuses_other_labels_and_other_greys(tmp_path: Path) -> None:
    path = tmp_path / "o.png"
    for wrong in (np.full((2, 2), 3, np.uint8), np.zeros((2, 2), bool), np.zeros((2, 2, 3), np.uint8)):
        with pytest.raises(FormatError, match=r"o\.png: occlusion labels are"):
            write_occlusion(path, wrong)
    assert not path.exists()
    write_png(path, np.array([[0, 255, 127]], np.uint8))
    with pytest.raises(FormatError, match=r"o\.png: grey 127"):
        read_occlusion(path)
    write_png(path, np.zeros((2, 2), np.uint16))
    with pytest.raises(FormatError, match=r"o\.png: occlusion is 8-bit"):
        read_occlusion(path)

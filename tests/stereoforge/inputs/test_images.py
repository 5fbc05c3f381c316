"""Reading a user's picture: what can be read, and one sentence in a user's words for what cannot."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from datagen.formats import write_pfm
from stereoforge.errors import CommandError
from stereoforge.inputs.images import pair_doubts, read_color_images

COLORS = np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8)


def test_grey_deep_and_transparent_pictures_become_8_bit_colour(tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    for pixels, expected in (
        (COLORS, COLORS),
        (COLORS[..., 0], np.repeat(COLORS[..., :1], 3, axis=2)),
        (np.dstack([COLORS, np.full_like(COLORS[..., :1], 255)]), COLORS),
        (np.dstack([COLORS, np.zeros_like(COLORS[..., :1])]), np.full_like(COLORS, 255)),
        (COLORS[..., 0].astype(np.uint16) * 257, np.repeat(COLORS[..., :1], 3, axis=2)),
        (COLORS[..., 0] > 127, np.where(COLORS[..., :1] > 127, 255, 0).repeat(3, axis=2)),
    ):
        iio.imwrite(path, pixels)
        left, right, remarks = read_color_images(path, path)
        np.testing.assert_array_equal(left, expected)
        np.testing.assert_array_equal(right, expected)
        assert remarks == []


def test_what_is_no_picture_is_said_without_the_decoder_s_words(tmp_path: Path) -> None:
    whole = tmp_path / "whole.png"
    iio.imwrite(whole, COLORS)
    (tmp_path / "text.png").write_text("hello")
    (tmp_path / "empty.png").touch()
    (tmp_path / "cut.png").write_bytes(whole.read_bytes()[:500])
    (tmp_path / "folder.png").mkdir()
    iio.imwrite(tmp_path / "moving.gif", np.stack([COLORS, 255 - COLORS]))
    iio.imwrite(tmp_path / "floats.tiff", COLORS.astype(np.float32))
    write_pfm(tmp_path / "map.pfm", COLORS[..., 0].astype(np.float32))
    unreadable = "is no picture that can be read (PNG, JPEG, TIFF, ...), or a damaged one"
    for name, sentence in (
        ("text.png", unreadable),
        ("empty.png", unreadable),
        ("cut.png", "is a PNG file cut off after 500 bytes"),
        ("folder.png", "is a folder, not a picture"),
        ("gone.png", "there is no such file"),
        ("moving.gif", "holds 2 pictures; one is needed"),
        ("floats.tiff", "holds float32 values; a picture has 8 or 16 bits a channel"),
        ("map.pfm", "is a map of numbers, not a picture; a disparity is given with --disparity"),
    ):
        with pytest.raises(CommandError) as refusal:
            read_color_images(whole, tmp_path / name)
        assert str(refusal.value) == f"{tmp_path / name}: {sentence}"


def test_pairs_that_are_wrong_as_a_whole() -> None:
    other, black, plain = 255 - COLORS, np.full_like(COLORS, 2), np.full_like(COLORS, 77)
    assert pair_doubts(COLORS, other) == []
    assert pair_doubts(COLORS, COLORS[:-1]) == []
    assert pair_doubts(COLORS, COLORS.copy()) == [
        "both pictures are the same: is the right view another file?"
    ]
    assert pair_doubts(black, COLORS) == ["the left picture is black"]
    assert pair_doubts(black, black) == ["the left picture is black", "the right picture is black"]
    assert pair_doubts(COLORS, plain) == ["the right picture has one colour only"]

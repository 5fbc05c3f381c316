"""One reader for all pictures: what each kind of file becomes, and what is refused."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from datagen.errors import FormatError
from datagen.formats.picture import PictureKindError, read_pair, read_picture
from stereoforge_kit.processes import call_limited
from tests.datagen.formats.test_fuzz import damage

RNG = np.random.default_rng(0)
COLORS = RNG.integers(0, 256, (20, 30, 3), np.uint8)
SMOOTH = np.stack(np.meshgrid(np.linspace(0, 255, 60), np.linspace(0, 255, 40)), -1)[..., [0, 1, 0]].astype(
    np.uint8
)


def saved(path: Path, image: Image.Image, **options: object) -> Path:
    image.save(path, **options)  # type: ignore[arg-type]
    return path


def exif(orientation: int) -> Image.Exif:
    tags = Image.Exif()
    tags[274] = orientation
    return tags


@pytest.mark.parametrize("suffix", ["png", "tif", "webp", "bmp", "gif"])
def test_what_is_lossless_is_exact(tmp_path: Path, suffix: str) -> None:
    colors = np.where(COLORS > 127, 255, 0).astype(np.uint8) if suffix == "gif" else COLORS
    options = {"lossless": True} if suffix == "webp" else {}
    path = saved(tmp_path / f"a.{suffix}", Image.fromarray(colors), **options)
    np.testing.assert_array_equal(read_picture(path), colors)


UPRIGHT = {
    1: lambda stored: stored,
    2: np.fliplr,
    3: lambda stored: np.rot90(stored, 2),
    4: np.flipud,
    5: lambda stored: stored.transpose(1, 0, 2),
    6: lambda stored: np.rot90(stored, -1),
    7: lambda stored: np.rot90(stored, 2).transpose(1, 0, 2),
    8: np.rot90,
}


@pytest.mark.parametrize("orientation", UPRIGHT)
@pytest.mark.parametrize("suffix", ["png", "jpg", "tif", "webp"])
def test_pictures_are_upright(tmp_path: Path, suffix: str, orientation: int) -> None:
    options = {"lossless": True} if suffix == "webp" else {"quality": 95} if suffix == "jpg" else {}
    path = saved(tmp_path / f"a.{suffix}", Image.fromarray(SMOOTH), exif=exif(orientation), **options)
    image = read_picture(path).astype(int)
    assert np.abs(image - UPRIGHT[orientation](SMOOTH)).max() <= (12 if suffix == "jpg" else 0)


def test_deep_tiff_files_are_upright(tmp_path: Path) -> None:
    deep = SMOOTH.astype(np.uint16) * 257
    assert cv2.imwrite(str(tmp_path / "a.tif"), deep[..., ::-1])
    np.testing.assert_array_equal(read_picture(tmp_path / "a.tif"), SMOOTH)
    grey = saved(tmp_path / "b.tif", Image.fromarray(deep[..., 0]), tiffinfo={274: 6})
    np.testing.assert_array_equal(read_picture(grey)[..., 1], np.rot90(SMOOTH[..., 0], -1))


@pytest.mark.parametrize("suffix", ["jpg", "tif"])
def test_inks_become_colours(tmp_path: Path, suffix: str) -> None:
    path = saved(
        tmp_path / f"a.{suffix}",
        Image.fromarray(SMOOTH).convert("CMYK"),
        **({"quality": 95} if suffix == "jpg" else {}),
    )
    assert np.abs(read_picture(path).astype(int) - SMOOTH).max() <= 16


@pytest.mark.parametrize("suffix", ["png", "webp", "tif"])
def test_what_is_transparent_shows_white(tmp_path: Path, suffix: str) -> None:
    alpha = np.full((20, 30, 1), 255, np.uint8)
    alpha[:5], alpha[5:10] = 0, 51
    options = {"lossless": True, "exact": True} if suffix == "webp" else {}
    path = saved(tmp_path / f"a.{suffix}", Image.fromarray(np.dstack([COLORS, alpha])), **options)
    image = read_picture(path)
    assert (image[:5] == 255).all()
    np.testing.assert_array_equal(image[5:10], np.rint(COLORS[5:10] * 0.2 + 204).astype(np.uint8))
    np.testing.assert_array_equal(image[10:], COLORS[10:])


def test_transparency_of_palettes_grey_and_16_bits(tmp_path: Path) -> None:
    palette = Image.fromarray(COLORS).quantize(4)
    path = saved(tmp_path / "palette.png", palette, transparency=0)
    assert (read_picture(path)[np.asarray(palette) == 0] == 255).all()
    grey = np.dstack([COLORS[..., 0], np.zeros((20, 30), np.uint8)])
    assert (read_picture(saved(tmp_path / "grey.png", Image.fromarray(grey, "LA"))) == 255).all()
    deep = np.dstack([COLORS, np.where(COLORS[..., 0] > 99, 255, 0)]).astype(np.uint16) * 257
    assert cv2.imwrite(str(tmp_path / "deep.png"), deep[..., [2, 1, 0, 3]])
    expected = np.where(COLORS[..., :1] > 99, COLORS, 255)
    np.testing.assert_array_equal(read_picture(tmp_path / "deep.png"), expected)


@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_12_bits_in_16_are_stretched_in_both_views_alike(tmp_path: Path, suffix: str) -> None:
    twelve = np.rint(COLORS / 255 * 4095).astype(np.uint16)
    left, right = tmp_path / f"l.{suffix}", tmp_path / f"r.{suffix}"
    assert cv2.imwrite(str(left), twelve[..., ::-1])
    assert cv2.imwrite(str(right), twelve[..., ::-1])
    np.testing.assert_array_equal(read_picture(left), COLORS)
    first, second, remarks = read_pair(left, right)
    np.testing.assert_array_equal(first, second)
    assert remarks == ["the pictures have 12 bits in 16-bit files; they are stretched"]
    brighter = twelve.copy()
    brighter[0, 0] = 5000
    assert cv2.imwrite(str(right), brighter[..., ::-1])
    first, second, remarks = read_pair(left, right)
    np.testing.assert_array_equal(first[1:], second[1:])
    assert first.max() == 16
    assert remarks == []


def test_the_second_picture_of_a_telephone_is_left_alone(tmp_path: Path) -> None:
    picture = Image.fromarray(SMOOTH)
    path = saved(
        tmp_path / "a.jpg", picture, format="MPO", save_all=True, append_images=[picture.resize((8, 8))]
    )
    assert read_picture(path).shape == SMOOTH.shape


def test_kinds_that_are_no_picture(tmp_path: Path) -> None:
    Image.fromarray(COLORS).save(
        tmp_path / "a.gif", save_all=True, append_images=[Image.fromarray(255 - COLORS)]
    )
    Image.fromarray(COLORS[..., 0].astype(np.float32)).save(tmp_path / "f.tif")
    (tmp_path / "map.pfm").write_bytes(b"Pf\n1 1\n-1\n1234")
    for name, sentence in (
        ("a.gif", "holds 2 pictures; one is needed"),
        ("f.tif", "holds float32 values; a picture has 8 or 16 bits a channel"),
        ("map.pfm", "is a map of numbers, not a picture"),
    ):
        with pytest.raises(PictureKindError) as refusal:
            read_picture(tmp_path / name)
        assert str(refusal.value) == f"{tmp_path / name}: {sentence}"


def huge_jpeg(side: int) -> bytes:
    """A whole JPEG whose header declares more than it holds."""
    buffer = io.BytesIO()
    Image.fromarray(SMOOTH).save(buffer, "JPEG")
    data = bytearray(buffer.getvalue())
    frame = data.index(b"\xff\xc0")
    struct.pack_into(">HH", data, frame + 5, side, side)
    return bytes(data)


@pytest.mark.parametrize("side", [10_000, 65_500])
def test_sizes_are_refused_by_the_header(tmp_path: Path, side: int) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(huge_jpeg(side))
    with pytest.raises(FormatError, match=r"a\.jpg: .*(numbers allowed|more pixels)"):
        call_limited(read_picture, (path,), memory_bytes=1 << 30, timeout_s=60.0)


@pytest.mark.parametrize("suffix", ["jpg", "webp", "tif", "bmp", "png"])
def test_files_that_are_cut_off(tmp_path: Path, suffix: str) -> None:
    path = saved(tmp_path / f"a.{suffix}", Image.fromarray(SMOOTH))
    content = path.read_bytes()
    for end in (0, 3, 40, len(content) // 2, len(content) * 9 // 10, len(content) - 20):
        path.write_bytes(content[:end])
        with pytest.raises(FormatError, match=rf"a\.{suffix}"):
            read_picture(path)


@pytest.mark.parametrize("suffix", ["jpg", "webp", "tif", "bmp", "gif", "png"])
def test_random_damage(tmp_path: Path, suffix: str) -> None:
    path = saved(tmp_path / f"a.{suffix}", Image.fromarray(SMOOTH))
    content, rng = path.read_bytes(), np.random.default_rng(1)
    sentences = []
    for _ in range(150):
        path.write_bytes(damage(content, rng))
        try:
            image = read_picture(path)
            assert (image.dtype, image.ndim) == (np.uint8, 3)
        except FormatError as error:
            sentences.append(str(error))
    assert len(sentences) > 15
    assert all(str(path) in sentence and "\n" not in sentence for sentence in sentences)


def test_a_reduced_picture_is_the_mean_over_white(tmp_path: Path) -> None:
    """Colours that are hidden by transparency must not shine through, as they do when alpha is averaged apart."""
    pixels = np.random.default_rng(0).integers(0, 256, (43, 90, 4), np.uint8)
    pixels[:20, :, 3] = 0
    path = tmp_path / "picture.png"
    Image.fromarray(pixels, "RGBA").save(path)
    whole = read_picture(path).astype(np.float64)
    reduced = read_picture(path, longest_px=30)
    assert reduced.shape == (14, 30, 3)
    means = whole[:42, :90].reshape(14, 3, 30, 3, 3).mean(axis=(1, 3))
    assert np.abs(reduced - means).max() <= 1
    assert (reduced[:6] == 255).all()
    assert read_picture(path, longest_px=50).shape == (43, 90, 3)


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "a.ppm", "a.bmp", "a.tif", "a.webp", "a.gif"])
def test_every_picture_can_be_written_to(name: str, tmp_path: Path) -> None:
    """Kernels are compiled for such arrays only: evaluating a set of JPEG files ended in numba's TypeError."""
    Image.new("RGB", (6, 4), (10, 200, 30)).save(tmp_path / name)
    image = read_picture(tmp_path / name)
    assert image.flags.writeable
    assert image.flags.c_contiguous

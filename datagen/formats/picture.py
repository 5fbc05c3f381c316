"""One reader for all pictures: those of data sets, of a user's pair and of user assets.

PNG files are checked chunk by chunk, and PGM and PPM files byte by byte. Pillow reads the headers of all others,
decodes them and tells how they are to be turned. OpenCV decodes TIFF files of 16 bits, which Pillow cuts to 8.
"""

from __future__ import annotations

import io
import re
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageOps
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from datagen.errors import FormatError
from datagen.formats.limits import (
    MAX_ELEMENTS,
    MAX_ELEMENTS_TO_REDUCE,
    check_image_size,
    read_bounded,
)
from datagen.formats.png import decode_png, read_png

_PNM_HEADER = re.compile(rb"P([56])(?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s+(\d{1,5})\s")
_FORMATS = ("JPEG", "TIFF", "WEBP", "BMP", "GIF", "JPEG2000", "PPM")
"""Pillow's names of what is read beside PNG; none of them starts another program."""
_FLOAT_MAPS = (b"PF", b"Pf")
_TWELVE_BITS = 4095
_PNG, _PNG_END = b"\x89PNG", b"IEND\xaeB`\x82"
_TIFF = (b"II*\0", b"MM\0*")
_WIDTH, _HEIGHT, _BITS_PER_SAMPLE = 256, 257, 258
"""Tags of TIFF."""
_TURNS: dict[int, Callable[[NDArray[Any]], NDArray[Any]]] = {
    2: lambda pixels: pixels[:, ::-1],
    3: lambda pixels: pixels[::-1, ::-1],
    4: lambda pixels: pixels[::-1],
    5: lambda pixels: np.swapaxes(pixels, 0, 1),
    6: lambda pixels: np.rot90(pixels, -1),
    7: lambda pixels: np.swapaxes(pixels[::-1, ::-1], 0, 1),
    8: np.rot90,
}
"""What brings a picture upright, by its Exif orientation."""

_STRIP_PX = 1 << 22
_PILLOW = threading.Lock()

Pixels = NDArray[np.uint8] | NDArray[np.uint16]


class PictureKindError(FormatError):
    """A picture that is whole, but of a kind or a size that cannot be used."""


def read_picture(path: Path | str, longest_px: int | None = None) -> NDArray[np.uint8]:
    """Read an image as (H, W, 3) uint8 RGB, upright.

    The Exif orientation is applied. Grey is repeated, CMYK and palettes are converted. What is transparent shows white
    behind it. 16 bits are scaled to 8; where no value is above 4095 the picture has 12 bits, and these are scaled to 8.

    Where `longest_px` is given, a picture whose longest side is twice that or more is divided by a whole number, so
    that this side stays at least so long. Such a picture may be larger than others, and costs its own 8 or 16 bits a
    number and little more; a JPEG file is decoded to a half, a quarter or an eighth of its size in the first place.

    Raises FormatError for a file that is missing or damaged, PictureKindError for one that holds several pictures, or
    numbers that are no colours, or more pixels than a picture has.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "grey.pgm"
    ...     _ = path.write_bytes(b"P5 2 1 255\\n" + bytes([7, 200]))
    ...     image = read_picture(path)
    >>> image.tolist()
    [[[7, 7, 7], [200, 200, 200]]]
    """
    return _color_of(_decode(Path(path), longest_px), longest_px)


def decode_picture(data: bytes, name: str, longest_px: int | None = None) -> NDArray[np.uint8]:
    """The colours of a picture that is part of another file, (H, W, 3) uint8, without regard to what is transparent.

    Otherwise, and with the errors, as `read_picture`; `name` is for messages. Bytes that fill up a PNG picture's place
    in the file do not matter.
    """
    if data.startswith(_PNG) and _PNG_END in data:
        data = data[: data.rindex(_PNG_END) + len(_PNG_END)]
    pixels = _decode(Path(name), longest_px, data)
    opaque = pixels[..., :-1] if pixels.ndim == 3 and pixels.shape[2] in (2, 4) else pixels
    return _color_of(opaque, longest_px)


def _color_of(pixels: Pixels, longest_px: int | None) -> NDArray[np.uint8]:
    full = _full_scale(pixels)
    return _as_color(pixels, full) if longest_px is None else _reduced(pixels, full, longest_px)


def read_pair(left: Path | str, right: Path | str) -> tuple[NDArray[np.uint8], NDArray[np.uint8], list[str]]:
    """Read both views as `read_picture` does, with the same scale of brightness, and remarks about them.

    Views of 16 bits are taken for 12 bits only if both fit. Raises as `read_picture` does.
    """
    views = _decode(Path(left)), _decode(Path(right))
    deep = [pixels for pixels in views if pixels.dtype == np.uint16]
    full = max(map(_full_scale, deep), default=255)
    images = [_as_color(pixels, full if pixels.dtype == np.uint16 else 255) for pixels in views]
    remarks = (
        ["the pictures have 12 bits in 16-bit files; they are stretched"] if full == _TWELVE_BITS else []
    )
    return images[0], images[1], remarks


def read_raster(path: Path | str) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Read the numbers of a PNG, PGM or PPM file unchanged: (H, W) or (H, W, C), uint8 or uint16.

    Raises FormatError for a file that is missing, damaged or none of these.
    """
    path = Path(path)
    return read_pnm(path) if path.suffix.lower() in (".pgm", ".ppm") else read_png(path)


def read_pnm(path: Path | str) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Read a binary PGM file, (H, W), or PPM file, (H, W, 3), as uint8 or uint16.

    16-bit numbers are big endian in these files (netpbm.sourceforge.net/doc/pgm.html). Raises FormatError for a
    file that is missing, damaged or neither.
    """
    return _decode_pnm(Path(path), read_bounded(Path(path)))


def _decode_pnm(path: Path, data: bytes) -> Pixels:
    header = _PNM_HEADER.match(data)
    if header is None:
        raise FormatError(f"{path}: is not a binary PGM or PPM file, its header does not parse")
    channels = 1 if header[1] == b"5" else 3
    width, height, largest = int(header[2]), int(header[3]), int(header[4])
    check_image_size(path, width, height, channels)
    if not 0 < largest < 2**16:
        raise FormatError(f"{path}: its header declares {largest} as the largest value, not 1 to 65535")
    kind = np.dtype("u1") if largest < 256 else np.dtype(">u2")
    expected = header.end() + width * height * channels * kind.itemsize
    if len(data) != expected:
        raise FormatError(f"{path}: has {len(data)} bytes where its header promises {expected}")
    values = np.frombuffer(data, kind, offset=header.end())
    values = values.reshape((height, width) if channels == 1 else (height, width, channels))
    return values.astype(np.uint8) if kind.itemsize == 1 else values.astype(np.uint16)


def _decode(path: Path, longest_px: int | None = None, data: bytes | None = None) -> Pixels:
    """The numbers of any picture, upright: (H, W) grey or (H, W, C) grey with alpha, RGB, or RGB with alpha.

    data: The content, where it has been read already.
    """
    data = read_bounded(path) if data is None else data
    if data[:2] in _FLOAT_MAPS:
        raise PictureKindError(f"{path}: is a map of numbers, not a picture")
    most = MAX_ELEMENTS if longest_px is None else MAX_ELEMENTS_TO_REDUCE
    if data.startswith(_PNG):
        pixels = decode_png(data, str(path), most)
        return _turned(pixels, _png_orientation(data, most)) if b"eXIf" in data else pixels
    if data[:2] in (b"P5", b"P6"):
        return _decode_pnm(path, data)
    return _decode_with_pillow(path, data, longest_px, most)


def _png_orientation(data: bytes, most: int) -> int:
    with _limit(most), Image.open(io.BytesIO(data)) as image:
        return int(image.getexif().get(ExifTags.Base.Orientation, 1))


def _turned(pixels: Pixels, orientation: int) -> Pixels:
    return np.ascontiguousarray(_TURNS[orientation](pixels)) if orientation in _TURNS else pixels


def _decode_with_pillow(path: Path, data: bytes, longest_px: int | None, most: int) -> Pixels:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Of odd metadata, and of sizes, which are checked here.
            if data[:4] in _TIFF and _is_deep(path, data, most):
                return _decode_deep_tiff(path, data)
            with _limit(most), Image.open(io.BytesIO(data), formats=_FORMATS) as image:
                if longest_px is not None:
                    image.draft(
                        None, (longest_px, longest_px)
                    )  # JPEG decodes to a half, a quarter, an eighth.
                _check_kind(path, image, most)
                image.load()
                return _as_array(path, ImageOps.exif_transpose(image))
    except FormatError:
        raise
    except Image.DecompressionBombError as error:
        raise PictureKindError(f"{path}: has more pixels than a picture of a data set") from error
    except Exception as error:  # Every decoder has its own exceptions, in words of its own.
        raise FormatError(
            f"{path}: is no picture that can be read (PNG, JPEG, TIFF, ...), or a damaged one"
        ) from error


@contextmanager
def _limit(most: int) -> Iterator[None]:
    """Without Pillow's own limit on pixels, which holds for the whole process, where more numbers may be decoded."""
    if most == MAX_ELEMENTS:
        yield
        return
    with _PILLOW:
        before, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
        try:
            yield
        finally:
            Image.MAX_IMAGE_PIXELS = before


def _check_kind(path: Path, image: Image.Image, most: int) -> None:
    """Refuse by the header what should not be decoded."""
    _check_size(path, *image.size, most)
    pictures = getattr(image, "n_frames", 1)
    if pictures > 1 and image.format != "MPO":  # Telephones add a preview or a map of brightness.
        raise PictureKindError(f"{path}: holds {pictures} pictures; one is needed")
    if image.mode == "F":
        raise _odd_values(path, "float32")


def _check_size(path: Path, width: int, height: int, most: int) -> None:
    try:
        check_image_size(path, width, height, 3, most)
    except FormatError as error:
        raise PictureKindError(str(error)) from error


def _is_deep(path: Path, data: bytes, most: int) -> bool:
    """Whether a TIFF file has more than 8 bits a channel, by its header."""
    file = io.BytesIO(data)
    tags = ImageFileDirectory_v2(file.read(8))
    file.seek(tags.next)
    tags.load(file)
    if max(tags.get(_BITS_PER_SAMPLE, (1,))) <= 8:
        return False
    _check_size(path, tags[_WIDTH], tags[_HEIGHT], most)
    if tags.next:
        raise PictureKindError(f"{path}: holds several pictures; one is needed")
    return True


def _decode_deep_tiff(path: Path, data: bytes) -> Pixels:
    """OpenCV turns it upright itself."""
    pixels: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise FormatError(f"{path}: is a TIFF file whose pixels do not decode")
    if pixels.dtype != np.uint16:
        raise _odd_values(path, str(pixels.dtype))
    if pixels.ndim == 3 and pixels.shape[2] in (3, 4):
        pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB if pixels.shape[2] == 3 else cv2.COLOR_BGRA2RGBA)
    return np.asarray(pixels)


def _as_array(path: Path, image: Image.Image) -> Pixels:
    """What Pillow decoded, without palettes and colour spaces of other kinds; a copy, since its own is read-only."""
    if image.mode.startswith("I;16"):
        return np.asarray(image).astype(np.uint16)
    if image.mode in ("I", "F"):
        raise _odd_values(path, "int32" if image.mode == "I" else "float32")
    if image.has_transparency_data:
        return np.array(image.convert("RGBA"))
    return np.array(image.convert("L" if image.mode in ("1", "L") else "RGB"))


def _odd_values(path: Path, kind: str) -> PictureKindError:
    return PictureKindError(f"{path}: holds {kind} values; a picture has 8 or 16 bits a channel")


def _reduced(pixels: Pixels, full: int, longest_px: int) -> NDArray[np.uint8]:
    """`_as_color`, divided by a whole number; in strips, since colours over white take four times the memory."""
    factor = max(pixels.shape[:2]) // longest_px
    if factor <= 1:
        return _as_color(pixels, full)
    height, width = (max(1, length // factor) for length in pixels.shape[:2])
    rows = max(1, _STRIP_PX // (factor * pixels.shape[1]))
    reduced = np.empty((height, width, 3), np.uint8)
    for top in range(0, height, rows):
        strip = _as_color(pixels[factor * top : factor * min(top + rows, height), : factor * width], full)
        size = (width, min(rows, height - top))
        reduced[top : top + rows] = cv2.resize(strip, size, interpolation=cv2.INTER_AREA)
    return reduced


def _full_scale(pixels: Pixels) -> int:
    """The number that stands for full brightness."""
    if pixels.dtype == np.uint8:
        return 255
    return _TWELVE_BITS if pixels.max() <= _TWELVE_BITS else 65535


def _as_color(pixels: Pixels, full: int) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 of what was decoded, over white."""
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    channels = pixels.shape[2]
    color: NDArray[Any]
    color, alpha = (pixels[..., :-1], pixels[..., -1:]) if channels in (2, 4) else (pixels, None)
    if alpha is not None and (alpha < full).any():
        # In float32 this is exact for 8 bits.
        opacity = np.minimum(alpha.astype(np.float32) / full, 1)
        color = color * (255 / full) * opacity + 255 * (1 - opacity)
    elif full != 255:
        color = color * (255 / full)
    if color.dtype != np.uint8:
        color = np.rint(np.minimum(color, 255)).astype(np.uint8)
    return np.ascontiguousarray(np.repeat(color, 3, axis=2) if color.shape[2] == 1 else color)

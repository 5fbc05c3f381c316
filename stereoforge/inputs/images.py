"""Read a picture that the user names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray

from stereoforge.errors import CommandError

LARGEST_SIDE_PX = 16384


def read_color_image(path: Path) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 of any picture file; grey is repeated, alpha dropped, 16 bits are scaled to 8.

    Raises CommandError for a missing file, one that is no picture, or one that is too large.
    """
    if not path.is_file():
        raise CommandError(
            f"{path}: is a folder, not a picture" if path.is_dir() else f"{path}: there is no such file"
        )
    if path.suffix.lower() == ".pfm":  # The decoder would round it to bytes.
        raise CommandError(
            f"{path}: is a map of numbers, not a picture; a disparity is given with --disparity"
        )
    try:
        shape = iio.improps(path).shape
        if max(shape[:2]) > LARGEST_SIDE_PX:
            raise CommandError(f"{path}: {shape[1]}x{shape[0]} pixels are more than {LARGEST_SIDE_PX} a side")
        pixels = np.asarray(iio.imread(path))
    except CommandError:
        raise
    except Exception as error:  # every decoder has its own exceptions, in words of its own
        raise CommandError(
            f"{path}: is no picture that can be read (PNG, JPEG, TIFF, ...), or a damaged one"
        ) from error
    return _as_color(path, pixels)


def _as_color(path: Path, pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """What a decoder gave as (H, W, 3) uint8."""
    if pixels.dtype == np.uint16:
        pixels = np.rint(pixels / 257.0).astype(np.uint8)
    if pixels.dtype == np.bool_:
        pixels = np.where(pixels, 255, 0).astype(np.uint8)
    if pixels.dtype != np.uint8:
        raise CommandError(f"{path}: holds {pixels.dtype} values; a picture has 8 or 16 bits a channel")
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    if pixels.ndim == 4:
        raise CommandError(f"{path}: holds {len(pixels)} pictures; one is needed")
    if pixels.shape[2] not in (3, 4):
        raise CommandError(
            f"{path}: has {pixels.shape[2]} channels; grey, colour and colour with alpha can be read"
        )
    return np.ascontiguousarray(pixels[..., :3])

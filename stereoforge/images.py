"""Reading a user's own picture."""

from __future__ import annotations

from pathlib import Path

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
        raise CommandError(f"{path}: there is no such file")
    try:
        shape = iio.improps(path).shape
        if max(shape[:2]) > LARGEST_SIDE_PX:
            raise CommandError(f"{path}: {shape[1]}x{shape[0]} pixels are more than {LARGEST_SIDE_PX} a side")
        pixels = np.asarray(iio.imread(path))
    except CommandError:
        raise
    except Exception as error:  # every decoder has its own exceptions
        raise CommandError(f"{path}: is not a picture that can be read ({error})") from error
    if pixels.dtype == np.uint16:
        pixels = np.rint(pixels / 257.0).astype(np.uint8)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype != np.uint8:
        raise CommandError(f"{path}: needs to be a grey or colour picture, got {pixels.dtype} {pixels.shape}")
    return np.ascontiguousarray(pixels[..., :3])

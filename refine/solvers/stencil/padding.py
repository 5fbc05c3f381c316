"""Images with a border of zeros, so that no kernel asks where the image ends."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from refine.solvers.arrays import FloatArray

MARGIN = 2
"""Width of the border in pixels: the reach of the 25-point stencil."""
_BAND_ROWS = 64


def pad(values: NDArray[Any], dtype: type = np.float32) -> NDArray[Any]:
    """Put a border of zeros around an image.

    Args:
        values: (..., H, W), an image or a stack of images.
        dtype: Of the result.

    Returns:
        (..., H + 2 MARGIN, W + 2 MARGIN), a copy.
    """
    padded: NDArray[Any] = np.zeros(
        (*values.shape[:-2], values.shape[-2] + 2 * MARGIN, values.shape[-1] + 2 * MARGIN), dtype
    )
    crop(padded)[...] = values
    return padded


def crop(padded: FloatArray) -> FloatArray:
    """The image without the border that `pad` gave it, as a view."""
    return padded[..., MARGIN:-MARGIN, MARGIN:-MARGIN]


def row_bands(height: int) -> Iterator[tuple[int, int]]:
    """Split the rows of an image into bands: first row, and the one after the last.

    What is assembled from the stencil weights needs them only once, so they never exist for the whole image.
    """
    for first in range(0, height, _BAND_ROWS):
        yield first, min(first + _BAND_ROWS, height)

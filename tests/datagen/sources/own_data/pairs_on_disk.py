"""Small sets as people have them, written with OpenCV and Pillow."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

HEIGHT, WIDTH = 6, 9


def picture(path: Path, value: int, size: tuple[int, int] = (HEIGHT, WIDTH)) -> Path:
    """One plain color, so that a test sees which file was read."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.full((*size, 3), value, np.uint8)).save(path)
    return path


def disparity(path: Path, value: float, size: tuple[int, int] = (HEIGHT, WIDTH)) -> Path:
    """Constant but for a corner without any; a PNG file has 256 units a pixel, a mask is 255 where it is not zero."""
    values: NDArray[np.generic] = np.full(size, value, np.float32)
    values[0, 0] = np.nan
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".png":
        values = np.nan_to_num(values * 256).astype(np.uint16)
    if path.suffix == ".npy":
        np.save(path, values)
    else:
        assert cv2.imwrite(str(path), values)
    return path


def mask(path: Path, values: NDArray[np.uint8]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), values)
    return path


def truth(value: float) -> NDArray[np.float32]:
    """What `disparity` is in memory."""
    values = np.full((HEIGHT, WIDTH), value, np.float32)
    values[0, 0] = np.nan
    return values


def folder(
    root: Path, left: str, right: str, truth: str | None, count: int = 2, right_truth: str | None = None
) -> Path:
    """So many pairs, with {} for the number i in paths; pictures are 10 i + 1 and 10 i + 2, disparities i + 1."""
    for i in range(count):
        picture(root / left.format(i), 10 * i + 1)
        picture(root / right.format(i), 10 * i + 2)
        if truth:
            disparity(root / truth.format(i), i + 1)
        if right_truth:
            disparity(root / right_truth.format(i), i + 2)
    return root

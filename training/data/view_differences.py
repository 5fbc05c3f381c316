"""What tells the images of two real cameras apart, drawn anew for every training sample.

Images are (H, W, 3) float32 in 0..1, though noise may have taken them a little beyond. None of it changes disparity.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stereoforge_kit.camera_effects import blurred, jpeg_compressed

Float32 = NDArray[np.float32]


def vertical_shifts(width: int, shift: float, roll_deg: float) -> NDArray[np.float64]:
    """(W,) px by which the columns of a view lie too low: a shift, and a roll about the middle of the image.

    Args:
        width: W.
        shift: Pixels of all columns.
        roll_deg: Degrees; positive lowers the right-hand side.
    """
    return shift + np.tan(np.deg2rad(roll_deg)) * (np.arange(width) + 0.5 - width / 2)


def one_view_blurred(
    rng: np.random.Generator, left: Float32, right: Float32, greatest_sigma: float
) -> tuple[Float32, Float32]:
    """(left, right) of which one, either, is blurred with a Gaussian of U(0, greatest_sigma) px."""
    sigma = rng.uniform(0, greatest_sigma)
    if rng.random() < 0.5:
        return blurred(left, (sigma, sigma)), right
    return left, blurred(right, (sigma, sigma))


def compressed(
    rng: np.random.Generator, left: Float32, right: Float32, quality: tuple[int, int]
) -> tuple[Float32, Float32]:
    """(left, right) after JPEG compression with one quality between the two given, both included; in 0..1."""
    drawn = int(rng.integers(quality[0], quality[1], endpoint=True))
    return _through_jpeg(left, drawn), _through_jpeg(right, drawn)


def _through_jpeg(image: Float32, quality: int) -> Float32:
    stored = np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)
    return jpeg_compressed(stored, quality).astype(np.float32) / np.float32(255)


def erased(rng: np.random.Generator, image: Float32, sides: tuple[float, float]) -> Float32:
    """The image with one or two rectangles of its mean colour, which may reach over the border.

    Args:
        rng: Source of all randomness.
        image: The right view, (H, W, 3).
        sides: Shortest and longest side of a rectangle in px.
    """
    height, width = image.shape[:2]
    covered, mean = image.copy(), image.mean(axis=(0, 1))
    for _ in range(rng.integers(1, 3)):
        left, top = int(rng.integers(width)), int(rng.integers(height))
        across, down = np.rint(rng.uniform(*sides, 2)).astype(int)
        covered[top : top + down, left : left + across] = mean
    return covered

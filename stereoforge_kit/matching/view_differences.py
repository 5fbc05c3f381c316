"""How differently two views show the same points: brightness and colour."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from stereoforge_kit.matching.features import Matches
from stereoforge_kit.srgb import to_linear

PATCH_SIGMA_PX = 2.0
"""Colours are means over so much, since features lie on edges."""
USABLE = (10 / 255, 240 / 255)
"""Pixel values between black and clipping."""
FEWEST = 10


@dataclass(frozen=True)
class ViewDifference:
    """Medians over matching points of the right view's values divided by the left one's."""

    pixel_values: float
    """Of brightness as it is stored."""
    light: float
    """Of brightness before sRGB's curve: the ratio of exposures, if the pictures are sRGB."""
    channels: tuple[float, float, float]
    """Of red, green and blue as they are stored, each divided by `pixel_values`."""


def compare_views(
    left: NDArray[np.uint8], right: NDArray[np.uint8], matches: Matches
) -> ViewDifference | None:
    """Compare two views, (H, W, 3) uint8, at their matches. None where too few are neither black nor clipped."""
    one, other = _colors(left, matches.left), _colors(right, matches.right)
    usable = ((one > USABLE[0]) & (one < USABLE[1]) & (other > USABLE[0]) & (other < USABLE[1])).all(axis=1)
    if usable.sum() < FEWEST:
        return None
    one, other = one[usable], other[usable]
    pixel_values = _ratio(one.mean(axis=1), other.mean(axis=1))
    red, green, blue = (_ratio(one[:, c], other[:, c]) / pixel_values for c in range(3))
    light = _ratio(to_linear(one).mean(axis=1), to_linear(other).mean(axis=1))
    return ViewDifference(pixel_values, light, (red, green, blue))


def _colors(view: NDArray[np.uint8], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) values from 0 to 1 around points (N, 2)."""
    smooth = cv2.GaussianBlur(
        view.astype(np.float32) / 255, (0, 0), PATCH_SIGMA_PX, borderType=cv2.BORDER_REPLICATE
    )
    x, y = (points[:, None, axis].astype(np.float32) for axis in (0, 1))
    values = cv2.remap(smooth, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(values[:, 0], np.float64)


def _ratio(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    return float(np.exp(np.median(np.log(other) - np.log(one))))

"""Weighted median filter guided by the image.

Z. Ma, K. He, Y. Wei, J. Sun, E. Wu, "Constant time weighted median filtering for stereo matching and beyond", ICCV
2013; Q. Zhang, L. Xu, J. Jia, "100+ times faster weighted median filter (WMF)", CVPR 2014.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from refine.method import EvaluationFrame, Method, MethodOutput
from stereoforge_kit.errors import InputError
from stereoforge_kit.kernels import njit, prange

LARGEST_SQUARED_DIFFERENCE = 3 * 255**2


@dataclass(frozen=True)
class WMF(Method):
    """At each pixel p the median of the window's disparities, each weighted by exp(-|I_p - I_q|^2 / 2 sigma^2).

    The same filter as Zhang et al.'s with their weights "exp", computed exactly: they, and OpenCV's version of
    their code, sort disparities into 256 bins and colours into 256 clusters to be fast, which moves a disparity by
    up to half a bin (0.4 px on 0..200 px). Confidence plays no part.
    """

    name: ClassVar[str] = "wmf"
    label: ClassVar[str] = "Weighted median"
    search: ClassVar = {"radius_px": (3, 5, 7, 10, 15), "sigma": (2.5, 5.0, 10.0, 25.5, 50.0, 100.0)}

    radius_px: int = 7
    """The window has 2 radius + 1 pixels a side; smaller at the image's borders. Not given in the paper (ours)."""
    sigma: float = 25.5
    """Colour difference over three channels, in 8-bit units, at which a weight has fallen to exp(-1/2)."""

    def __post_init__(self) -> None:
        if self.radius_px < 0 or not self.sigma > 0:
            raise InputError(
                f"the weighted median needs a radius of at least 0 and a positive sigma, got {self.radius_px} "
                f"and {self.sigma}"
            )

    def run(self, frame: EvaluationFrame) -> MethodOutput:
        """Filter the frame's initial disparity."""
        return MethodOutput(weighted_median(frame.disparity, frame.image, self.radius_px, self.sigma))


def weighted_median(
    values: NDArray[np.float32], image: NDArray[np.uint8], radius_px: int, sigma: float
) -> NDArray[np.float32]:
    """The filter of `WMF`: the least window value at which the weights up to it reach half of their sum.

    Args:
        values: (H, W); NaN takes no part, and becomes the median of what is known in its window.
        image: (H, W, 3).

    Returns:
        (H, W), NaN where a window knows nothing.
    """
    weight_of = np.exp(-np.arange(LARGEST_SQUARED_DIFFERENCE + 1) / (2 * sigma**2))
    return _filter(
        np.ascontiguousarray(values, np.float32), np.ascontiguousarray(image), radius_px, weight_of
    )


@njit()
def _weighted_median(values, weights, count, half):  # type: ignore[no-untyped-def]
    """Quickselect: split the candidates [low, high) around a pivot and keep the part that `half` falls into."""
    if count == 0:
        return np.float32(np.nan)
    low, high, below = 0, count, 0.0
    while True:
        pivot = values[(low + high) // 2]
        less, i, greater = low, low, high
        weight_less, weight_equal = 0.0, 0.0
        while i < greater:
            value, weight = values[i], weights[i]
            if value < pivot:
                values[i], weights[i] = values[less], weights[less]
                values[less], weights[less] = value, weight
                weight_less += weight
                less += 1
                i += 1
            elif value > pivot:
                greater -= 1
                values[i], weights[i] = values[greater], weights[greater]
                values[greater], weights[greater] = value, weight
            else:
                weight_equal += weight
                i += 1
        if less > low and below + weight_less >= half:
            high = less
        elif greater == high or below + weight_less + weight_equal >= half:
            return pivot
        else:
            below += weight_less + weight_equal
            low = greater


@njit(parallel=True)
def _filter(values, image, radius, weight_of):  # type: ignore[no-untyped-def]
    height, width = values.shape
    result = np.empty_like(values)
    for y in prange(height):
        window = np.empty((2 * radius + 1) ** 2, np.float32)
        weights = np.empty(window.size)
        for x in range(width):
            count, total = 0, 0.0
            for v in range(max(0, y - radius), min(height, y + radius + 1)):
                for u in range(max(0, x - radius), min(width, x + radius + 1)):
                    if not np.isnan(values[v, u]):
                        squared = np.int64(0)
                        for c in range(3):
                            squared += (np.int64(image[y, x, c]) - np.int64(image[v, u, c])) ** 2
                        window[count] = values[v, u]
                        weights[count] = weight_of[squared]
                        total += weights[count]
                        count += 1
            result[y, x] = _weighted_median(window, weights, count, total / 2)
    return result

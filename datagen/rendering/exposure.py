"""From scene-linear radiance to 8-bit sRGB pictures, as a camera with automatic exposure makes them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

HIGHLIGHT_PERCENTILE = 98.0
HIGHLIGHT_CEILING = 1.1
"""The exposure may raise that percentile of luminance to this at most, so that bright scenes keep their highlights."""
_REC709 = np.array([0.2126, 0.7152, 0.0722], np.float32)


def automatic_exposure(radiance: NDArray[np.float32], key: float) -> float:
    """The factor that brings the log-average luminance to `key` without burning out the highlights.

    The rule is that of Reinhard et al., "Photographic tone reproduction for digital images" (SIGGRAPH 2002).

    Args:
        radiance: (H, W, 3) linear RGB.
        key: The luminance that the average shall have, 1 being white.
    """
    luminance = radiance @ _REC709
    log_average = float(np.exp(np.mean(np.log(np.maximum(luminance, 1e-4)))))
    highlight = float(np.percentile(luminance, HIGHLIGHT_PERCENTILE))
    return min(key / log_average, HIGHLIGHT_CEILING / max(highlight, 1e-4))


def develop(radiance: NDArray[np.float32], exposure: float) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB of linear radiance (H, W, 3) times the exposure (IEC 61966-2-1 transfer function)."""
    linear = np.clip(radiance * np.float32(exposure), 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255.0).astype(np.uint8)

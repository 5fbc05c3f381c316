"""From scene-linear radiance to 8-bit sRGB pictures, as a camera with automatic exposure makes them.

All families share one metering and one tone curve. The curve is linear up to a knee above middle grey, so that
surfaces keep their colours, and then bends towards white without reaching it for a while, as film does: lamps and
skies fade instead of being cut off. The lens's glare lifts the blacks a little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

HIGHLIGHT_PERCENTILE = 98.0
HIGHLIGHT_CEILING = 1.1
"""The exposure may raise that percentile of luminance to this at most, so that bright scenes keep their highlights."""
HIGHLIGHT_STOPS = 1.0
"""Highlights darken a picture by this many stops at most, as long as that leaves them below `CUT_OFF`."""
CUT_OFF = 3.3
"""Light, 1 being white, from which on a channel is 255."""
KNEE = 0.4
"""Light up to this level, 1 being white, is developed as it is; brighter light is rolled off."""
GLARE = 0.0015
"""Light that the lens spreads over the whole picture, 1 being white."""
_REC709 = np.array([0.2126, 0.7152, 0.0722], np.float32)


def automatic_exposure(radiance: NDArray[np.float32], key: float) -> float:
    """The factor that brings the log-average luminance to `key` without burning out the highlights.

    The rule is that of Reinhard et al., "Photographic tone reproduction for digital images" (SIGGRAPH 2002). A lamp in
    a dark room does not turn the room black: a picture is `HIGHLIGHT_STOPS` darker than `key` at most, or as dark as
    `100 - HIGHLIGHT_PERCENTILE` per cent of its pixels with a channel that is cut off demand.

    Args:
        radiance: (H, W, 3) linear RGB.
        key: The luminance that the average shall have, 1 being white.
    """
    luminance = radiance @ _REC709
    log_average = float(np.exp(np.mean(np.log(np.maximum(luminance, 1e-4)))))
    highlight = float(np.percentile(luminance, HIGHLIGHT_PERCENTILE))
    brightest = float(np.percentile(radiance.max(axis=2), HIGHLIGHT_PERCENTILE))
    kept = HIGHLIGHT_CEILING / max(highlight, 1e-4)
    darkest = min(2.0**-HIGHLIGHT_STOPS * key / log_average, CUT_OFF / max(brightest, 1e-4))
    return min(key / log_average, max(kept, darkest))


def develop(radiance: NDArray[np.float32], exposure: float) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 sRGB of linear radiance (H, W, 3) times the exposure (IEC 61966-2-1 transfer function)."""
    linear = _rolled_off(np.maximum(radiance * np.float32(exposure), 0.0) + np.float32(GLARE))
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255.0).astype(np.uint8)


def _rolled_off(light: NDArray[np.float32]) -> NDArray[np.float32]:
    """Light (...) of any level, 1 being white, in 0..1: linear up to `KNEE`, from there on 1 - exp(-x) towards 1."""
    room = np.float32(1 - KNEE)
    above = np.maximum(light - np.float32(KNEE), 0.0) / room
    rolled: NDArray[np.float32] = np.minimum(light, np.float32(KNEE)) - room * np.expm1(-above)
    return rolled

"""sRGB's levels and the light they stand for (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def to_srgb(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear levels 0..1 as sRGB's."""
    return np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055
    )


def to_linear(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """sRGB's levels 0..1 as linear ones."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)

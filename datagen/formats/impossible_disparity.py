"""Disparities that cannot be.

Files mark pixels without a disparity in many ways: infinity, NaN, and numbers such as 65535, 1e30 or -999 that no
documentation mentions. One rule finds them all, whoever reads the file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

GROUND_TRUTH_NOISE_PX = 0.5
"""Measured ground truth may be negative by this much where a point is far away."""
PREDICTION_NOISE_PX = 1.0
"""The same for what another method predicts."""


@dataclass(frozen=True)
class ImpossibleShare:
    """Which shares (0..1) of the finite disparities of a view are impossible. It is false if there are none."""

    negative: float = 0.0
    """Below zero by more than noise."""
    too_large: float = 0.0
    """Larger than the picture is wide."""

    @property
    def share(self) -> float:
        """Of both kinds."""
        return self.negative + self.too_large

    def __bool__(self) -> bool:
        return self.share > 0

    def __str__(self) -> str:
        kinds = ((self.too_large, "larger than the picture is wide"), (self.negative, "negative"))
        parts = ", ".join(f"{share:.2%} {what}" for share, what in kinds if share > 0)
        return f"{self.share:.2%} of the disparities cannot be and are left out ({parts})"


def drop_impossible(
    disparity: NDArray[np.floating[Any]], noise_px: float = GROUND_TRUTH_NOISE_PX, at_infinity: float = 0.0
) -> tuple[NDArray[np.float32], ImpossibleShare]:
    """Turn disparities that cannot be into NaN: not finite, larger than the picture is wide, or farther than infinity.

    Args:
        disparity: (H, W) px.
        noise_px: Disparities that are less by no more than this are those of points far away, and become `at_infinity`.
        at_infinity: The disparity of what is infinitely far, 0 unless the views' principal points differ.

    Returns:
        (H, W) float32 px with NaN where there is none, and the share of impossible ones among the finite ones.

    >>> kept, share = drop_impossible(np.array([[3.5, 65535.0, -0.25, np.inf]]))
    >>> kept.tolist(), round(share.too_large, 3)
    ([[3.5, nan, 0.0, nan]], 0.333)
    """
    finite = np.isfinite(disparity)
    negative = finite & (disparity < at_infinity - noise_px)
    too_large = finite & (disparity > disparity.shape[1])
    kept = np.where(
        finite & ~negative & ~too_large, np.maximum(disparity, np.float32(at_infinity)), np.nan
    ).astype(np.float32)
    count = max(int(finite.sum()), 1)
    return kept, ImpossibleShare(float(negative.sum()) / count, float(too_large.sum()) / count)

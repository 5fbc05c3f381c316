"""Sentences on what looks like a mistake: views that are swapped, a disparity in another unit or of the other sign."""

from __future__ import annotations

import numpy as np

from stereoforge.pipelines.prediction import Image, Map
from stereoforge.pipelines.refiner import RefinedPair
from stereoforge_kit.matching import seem_swapped

FEW_KNOWN = 0.1
"""A disparity from another predictor that is known at a smaller share of the pixels is taken for a mistake."""
LOW_CONFIDENCE = 0.15
"""A mean confidence below this, too: the bundled weights give 0.4 on photographs, 0.1 on two that do not belong
together."""
BEYOND_INFINITY_PX = -0.5
BEYOND_INFINITY = 0.01
"""A share of disparities below that which is worth a remark."""


def view_doubts(left: Image, right: Image) -> list[str]:
    """A sentence if the views, (H, W, 3) each, seem to be swapped."""
    if not seem_swapped(left, right):
        return []
    return ["more of the pair can be matched the other way round: is the first picture the left one?"]


def disparity_doubts(given: Map) -> list[str]:
    """What is odd about a disparity of another predictor, (H, W) px, NaN where there is none."""
    doubts = []
    known = np.isfinite(given).mean()
    if known < FEW_KNOWN:
        doubts.append(
            f"only {known:.1%} of the disparity is known: is it positive, in pixels of the left view?"
        )
    if (largest := np.nanquantile(given, 0.99)) < 1:
        doubts.append(f"the disparity is hardly anywhere above {largest:.2g} px: is it in pixels?")
    return doubts


def result_doubts(refined: RefinedPair) -> list[str]:
    """What is odd about a result: hardly any confidence, or many disparities beyond infinity."""
    doubts = []
    if (mean := refined.confidence.mean()) < LOW_CONFIDENCE:
        doubts.append(
            f"the confidence is low nearly everywhere (mean {mean:.2f}): are the views rectified, the "
            "left one first, and the disparity in pixels?"
        )
    share = float((refined.disparity < BEYOND_INFINITY_PX).mean())
    if share >= BEYOND_INFINITY:
        doubts.append(
            f"{share:.0%} of the refined disparities are negative, down to {refined.disparity.min():.1f} px"
        )
    return doubts
